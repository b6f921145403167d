"""The command `matrix`: its cells, its options, and how it skips or fails."""

import subprocess
from pathlib import Path
from unittest.mock import Mock

import pytest

from blender_tests.engine.conftest import ROOT
from tools import cells, dev

CELLS = {cell.name: cell for cell in cells.all_cells()}


def test_cells_cover_lowest_and_newest_versions():
    lowest = CELLS["engine-lowest"]
    assert lowest.resolution == "lowest-direct" and f">={lowest.python}" == cells.PROJECT["requires-python"]
    assert set(cells.PROJECT["dependencies"]) <= set(lowest.requirements)
    assert all(CELLS[f"engine-{python}"].requirements == lowest.requirements for python in ("3.11", "3.12", "3.13"))
    manifest = (ROOT / "blender_manifest.toml").read_text(encoding="utf-8")
    assert 'blender_version_min = "4.2.0"' in manifest and "bpy>=4.2,<4.3" in CELLS["addon-4.2"].requirements


def test_quick_run_keeps_a_test_in_every_folder():
    slow = {ROOT / name for name in cells.SLOW}
    assert all(path.exists() for path in slow)
    for folder in {path.parent for path in (ROOT / "blender_tests" / "engine").rglob("test_*.py")} - slow:
        assert set(folder.glob("test_*.py")) - slow, f"{folder} has no quick test"


@pytest.mark.parametrize(
    ("message", "error"),
    [
        ("error: Failed to fetch: tunnel error", cells.Unavailable),
        ("error: No solution found when resolving dependencies", cells.Unresolvable),
    ],
)
def test_failed_downloads_differ_from_version_conflicts(monkeypatch, message, error):
    monkeypatch.setattr(subprocess, "run", lambda *_, **__: subprocess.CompletedProcess([], 1, "", message))
    with pytest.raises(error):
        cells.install(CELLS["engine-3.12"], Path("anywhere"))


def test_options_are_passed_to_nox(monkeypatch, tmp_path):
    command = []
    monkeypatch.setattr(dev, "setup", lambda *environments: None)
    monkeypatch.setattr(dev, "_run", lambda *arguments, **variables: command.extend(arguments) or 0)
    out = tmp_path / "matrix" / "results.json"
    assert dev.run_matrix(None, ["addon-4.2", "engine-3.11", "--out", str(out), "--quick", "--strict"]) == 0
    assert command[:6] == ["nox", "-m", "nox", "--session", "addon-4.2", "engine-3.11"]
    assert command[6:] == ["--error-on-missing-interpreters", "--report", str(out), "--", "quick", "strict"]
    assert out.parent.is_dir()


@pytest.mark.parametrize(("options", "code"), [([], 0), (["--strict"], 1)])
def test_matrix_is_skipped_without_network(monkeypatch, capsys, options, code):
    monkeypatch.setattr(dev, "setup", Mock(side_effect=subprocess.CalledProcessError(1, "pip")))
    assert dev.run_matrix(None, options) == code
    assert "matrix: skipped, nox could not be downloaded" in capsys.readouterr().out
