"""The workflow files of a public host: they only call what anyone can call on a desk."""

import re
import subprocess
import sys

import pytest

yaml = pytest.importorskip("yaml", reason="it comes with the extra `lint`")

from blender_tests.engine.conftest import ROOT
from tools.cells import all_cells

FILES = sorted((ROOT / ".github" / "workflows").glob("*.yml"))
COMMAND = re.compile(r"tools/dev\.py ([\w-]+)")


def jobs(file):
    return yaml.safe_load(file.read_text(encoding="utf-8"))["jobs"]


def steps(file):
    return [step for job in jobs(file).values() for step in job["steps"]]


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.name)
def test_every_step_runs_a_command_or_an_action_of_a_pinned_major_version(file):
    for step in steps(file):
        assert ("run" in step) != ("uses" in step)
        assert re.fullmatch(r"actions/[\w-]+@v\d+", step.get("uses", "actions/none@v0"))


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.name)
def test_every_job_ends_by_itself_and_may_only_read(file):
    assert all(job["timeout-minutes"] <= 90 for job in jobs(file).values())
    assert yaml.safe_load(file.read_text(encoding="utf-8"))["permissions"] == {"contents": "read"}


@pytest.mark.parametrize("verb", sorted({verb for file in FILES for verb in COMMAND.findall(file.read_text("utf-8"))}))
def test_every_command_of_the_workflows_exists(verb):
    done = subprocess.run([sys.executable, "tools/dev.py", verb, "--help"], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0 and f"dev.py {verb}" in done.stdout


def test_every_cell_of_the_workflows_exists():
    named = [cell for file in FILES for job in jobs(file).values() for cell in _matrix(job).get("cell", [])]
    assert named and set(named) <= {cell.name for cell in all_cells()}


def _matrix(job):
    return job.get("strategy", {}).get("matrix", {})


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.name)
def test_no_host_is_named(file):
    assert "://" not in file.read_text(encoding="utf-8")
