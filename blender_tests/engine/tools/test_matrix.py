"""The command `matrix`: its cells, what is skipped and what fails, and what it hands to nox."""

import subprocess
from pathlib import Path

import pytest

from blender_tests.engine.conftest import ROOT
from tools import cells, dev

CELLS = {cell.name: cell for cell in cells.all_cells()}


def test_cells_have_the_lowest_and_newest_versions_of_the_declared_ranges():
    lowest = CELLS["engine-lowest"]
    assert lowest.resolution == "lowest-direct" and f">={lowest.python}" == cells.PROJECT["requires-python"]
    assert set(cells.PROJECT["dependencies"]) <= set(lowest.requirements)
    assert all(CELLS[f"engine-{python}"].requirements == lowest.requirements for python in ("3.11", "3.12", "3.13"))
    manifest = (ROOT / "blender_manifest.toml").read_text(encoding="utf-8")
    assert 'blender_version_min = "4.2.0"' in manifest and "bpy>=4.2,<4.3" in CELLS["addon-4.2"].requirements


def test_a_quick_run_leaves_tests_in_every_room_that_it_enters():
    left_out = {ROOT / name for name in cells.SLOW}
    assert all(path.exists() for path in left_out)
    folders = {path.parent for path in (ROOT / "blender_tests" / "engine").rglob("test_*.py")} - left_out
    for folder in folders:
        assert set(folder.glob("test_*.py")) - left_out, f"{folder} has no quick test"


@pytest.mark.parametrize(
    ("said", "raised"),
    [
        ("error: Failed to fetch: tunnel error", cells.Unavailable),
        ("error: No solution found when resolving dependencies", cells.Unresolvable),
    ],
)
def test_what_cannot_be_downloaded_differs_from_what_does_not_go_together(monkeypatch, said, raised):
    monkeypatch.setattr(subprocess, "run", lambda *_, **__: subprocess.CompletedProcess([], 1, "", said))
    with pytest.raises(raised):
        cells.install(CELLS["engine-3.12"], Path("anywhere"))


def test_options_are_handed_to_nox(monkeypatch, tmp_path):
    given = []
    monkeypatch.setattr(dev, "setup", lambda *environments: None)
    monkeypatch.setattr(dev, "_run", lambda *arguments, **variables: given.extend(arguments) or 0)
    out = tmp_path / "matrix" / "results.json"
    assert dev.run_matrix(None, ["addon-4.2", "engine-3.11", "--out", str(out), "--quick", "--strict"]) == 0
    assert given[:6] == ["nox", "-m", "nox", "--session", "addon-4.2", "engine-3.11"]
    assert given[6:] == ["--error-on-missing-interpreters", "--report", str(out), "--", "quick", "strict"]
    assert out.parent.is_dir()


@pytest.mark.parametrize(("options", "code"), [([], 0), (["--strict"], 1)])
def test_without_a_network_nothing_runs_and_it_is_said(monkeypatch, capsys, options, code):
    def fail(*environments):
        raise subprocess.CalledProcessError(1, "pip")

    monkeypatch.setattr(dev, "setup", fail)
    assert dev.run_matrix(None, options) == code
    assert "matrix: skipped, nox could not be downloaded" in capsys.readouterr().out
