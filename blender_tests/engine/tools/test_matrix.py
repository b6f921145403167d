"""The command `matrix`: what it runs, what it skips and says, and the table that it writes."""

import subprocess
import sys
from dataclasses import asdict, replace
from pathlib import Path

import pytest

from blender_tests.engine.conftest import ROOT
from tools.matrix import environments, page, running
from tools.matrix.cells import PROJECT, SLOW, Cell, all_cells

CELLS = {cell.name: cell for cell in all_cells()}
CELL = Cell("engine-3.12", "3.12", ("numpy>=2", "pytest"), "highest", "blender_tests/engine")


@pytest.fixture
def uv(monkeypatch):
    """Stands in for uv: answers with this return code, output and errors."""
    answer = {"returncode": 0, "stdout": sys.executable, "stderr": ""}
    monkeypatch.setattr(
        environments, "_uv", lambda *arguments, **options: subprocess.CompletedProcess(arguments, **answer)
    )
    return answer


# ---------------------------------------------------------------------------------------------------------------- cells
def test_the_engine_is_tested_on_the_lowest_and_newest_versions_of_its_own_ranges():
    lowest = CELLS["engine-lowest"]
    assert lowest.resolution == "lowest-direct" and f">={lowest.python}" == PROJECT["requires-python"]
    assert set(PROJECT["dependencies"]) <= set(lowest.requirements)
    assert all(CELLS[f"engine-{python}"].requirements == lowest.requirements for python in ("3.11", "3.12", "3.13"))


def test_the_extension_is_tested_on_the_oldest_blender_that_its_manifest_allows():
    manifest = (ROOT / "blender_manifest.toml").read_text(encoding="utf-8")
    assert 'blender_version_min = "4.2.0"' in manifest and "bpy>=4.2,<4.3" in CELLS["addon-4.2"].requirements


def test_a_quick_run_leaves_tests_in_every_room():
    left_out = {ROOT / name for name in SLOW}
    assert all(path.is_file() for path in left_out)
    for folder in {path.parent for path in (ROOT / "blender_tests" / "engine").rglob("test_*.py")}:
        assert set(folder.glob("test_*.py")) - left_out, f"{folder} has no quick test"


# --------------------------------------------------------------------------------------------------------------- skipped
def test_a_python_that_is_not_here_skips_its_cell(uv):
    uv["returncode"] = 2
    result = running.run(CELL, True, {})
    assert (result.status, result.reason) == ("skipped", "Python 3.12 is not installed here")


def test_an_index_that_does_not_answer_skips_its_cell(uv, monkeypatch):
    monkeypatch.setattr(environments, "find_python", lambda version: Path(sys.executable))
    uv.update(returncode=2, stderr="error: Failed to fetch: tunnel error")
    result = running.run(CELL, True, {})
    assert (result.status, result.reason) == ("skipped", "which versions there are could not be asked")


def test_packages_that_do_not_go_together_fail_their_cell(uv, monkeypatch):
    monkeypatch.setattr(environments, "find_python", lambda version: Path(sys.executable))
    uv.update(returncode=1, stderr="error: No solution found when resolving dependencies")
    result = running.run(CELL, True, {})
    assert result.status == "failed" and "no versions of numpy, pytest go together" in result.reason


@pytest.mark.parametrize(("python", "is_the_same"), [("3.12", True), ("3.13", False)])
def test_the_very_same_packages_are_not_tested_twice_on_the_same_python(monkeypatch, python, is_the_same):
    same = environments.Environment(Path(sys.executable), "numpy==2.0.2\npytest==9.2.0\n")
    monkeypatch.setattr(environments, "make", lambda cell: same)
    monkeypatch.setattr(running, "_tested", lambda result, *_: replace(result, status="passed"))
    result = running.run(CELL, True, {(python, same.lock): "another"})
    expected = ("skipped", "the same packages as another") if is_the_same else ("passed", "")
    assert (result.status, result.reason) == expected


# ------------------------------------------------------------------------------------------------------------------- run
@pytest.fixture
def tested(monkeypatch, tmp_path):
    """Runs a cell in this environment on a file of tests that is given as text."""
    environment = environments.Environment(Path(sys.executable), "numpy==2.0.2\npytest==9.2.0\n")
    monkeypatch.setattr(environments, "make", lambda cell: environment)

    def run(text):
        (tmp_path / "test_it.py").write_text(text, encoding="utf-8")
        return running.run(Cell("engine-3.12", "3.12", CELL.requirements, "highest", str(tmp_path)), False, {})

    return run


def test_tests_are_counted_and_those_that_fail_are_named(tested):
    result = tested(
        "import pytest\n"
        "def test_good(): pass\n"
        "def test_bad(): assert False\n"
        "def test_none(): pytest.skip('why')\n"
        "def test_broken(missing): pass\n"
    )
    assert (result.status, result.n_passed, result.n_failed, result.n_skipped) == ("failed", 1, 2, 1)
    assert sorted(name.rpartition("::")[2] for name in result.failures) == ["test_bad", "test_broken"]
    assert result.packages == {"numpy": "2.0.2", "pytest": "9.2.0"}


def test_a_cell_whose_tests_pass_has_passed(tested):
    result = tested("def test_good(): pass\n")
    assert (result.status, result.n_passed, result.tests) == ("passed", 1, "all")


def test_a_crash_is_a_failure_and_says_so(tested):
    result = tested("import os\ndef test_crash(): os._exit(7)\n")
    assert (result.status, result.reason) == ("failed", "the tests crashed (exit code 7)")


# ------------------------------------------------------------------------------------------------------------------ page
def row(cell, status, **more):
    return asdict(running.Result(cell, status, **more))


def test_a_cell_that_is_skipped_later_keeps_what_came_of_it(tmp_path):
    path = tmp_path / "results.json"
    page.write_cells([row("engine-3.12", "passed", python="3.12.1", packages={}, n_passed=5)], "Monday", path)
    page.write_cells(
        [row("engine-3.12", "skipped", reason="no network"), row("engine-3.11", "skipped")], "Tuesday", path
    )
    known = {row["cell"]: row for row in page.read(path)["cells"]}
    assert list(known) == ["engine-3.11", "engine-3.12"]
    assert (known["engine-3.12"]["n_passed"], known["engine-3.12"]["made"]) == (5, "Monday")


def test_what_is_known_of_wheels_stays_when_cells_run(tmp_path):
    path = tmp_path / "results.json"
    page.write_wheels({"Windows": {"3.9": "no", "3.11": "yes"}}, "Monday", path)
    page.write_cells([row("engine-3.12", "passed", python="3.12.1", packages={})], "Tuesday", path)
    table = page.wheels_table(page.read(path)["wheels"])
    assert "| system | Python 3.9 | Python 3.11 |" in table and "| Windows | no | yes |" in table and "Monday" in table


def test_the_page_is_what_the_results_give():
    assert page.PAGE.read_text(encoding="utf-8") == page.page(), "run python3 -m tools.matrix.page"
