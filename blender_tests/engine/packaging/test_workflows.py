"""The workflow files and the Dockerfile, checked without running them."""

import json
import re
import subprocess
import sys

import pytest

yaml = pytest.importorskip("yaml", reason="part of the extra `lint`")

from blender_tests.engine.conftest import ROOT
from tools import dev
from tools.cells import all_cells

FILES = sorted((ROOT / ".github" / "workflows").glob("*.yml"))
COMMAND = re.compile(r"tools/dev\.py ([\w-]+)")
RECIPE = re.sub(r"\\\n\s*", "", (ROOT / "Dockerfile").read_text(encoding="utf-8")).splitlines()


def jobs(file):
    return yaml.safe_load(file.read_text(encoding="utf-8"))["jobs"]


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.name)
def test_workflow_is_read_only_limited_in_time_and_pinned(file):
    text = file.read_text(encoding="utf-8")
    assert "://" not in text  # no host is named
    assert yaml.safe_load(text)["permissions"] == {"contents": "read"}
    for job in jobs(file).values():
        assert job["timeout-minutes"] <= 90
        for step in job["steps"]:
            assert ("run" in step) != ("uses" in step)
            assert re.fullmatch(r"actions/[\w-]+@v\d+", step.get("uses", "actions/none@v0"))


@pytest.mark.parametrize("verb", sorted({verb for file in FILES for verb in COMMAND.findall(file.read_text("utf-8"))}))
def test_workflow_commands_exist(verb):
    done = subprocess.run([sys.executable, "tools/dev.py", verb, "--help"], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0 and f"dev.py {verb}" in done.stdout


def test_workflow_cells_exist():
    matrices = [job.get("strategy", {}).get("matrix", {}) for file in FILES for job in jobs(file).values()]
    named = [cell for matrix in matrices for cell in matrix.get("cell", [])]
    assert named and set(named) <= {cell.name for cell in all_cells()}


def instruction(name):
    return [line.removeprefix(name).strip() for line in RECIPE if line.startswith(f"{name} ")]


def test_container_installs_the_libraries_of_blender():
    (install,) = (line for line in instruction("RUN") if "apt-get install" in line)
    assert set(dev.BLENDER_LIBRARIES.split()) == {word for word in install.split() if word.startswith("lib")}


def test_container_runs_its_commands_without_root():
    (command,), (default,) = instruction("ENTRYPOINT"), instruction("CMD")
    assert json.loads(command) == ["python3", "tools/dev.py"]
    assert json.loads(default) == ["test"]
    assert instruction("USER") == ["karf"]
    assert RECIPE.index("USER karf") < RECIPE.index("RUN python3 tools/dev.py setup")


def test_setup_layer_copies_only_its_inputs():
    copied = [line.split()[-2] for line in RECIPE[: RECIPE.index("RUN python3 tools/dev.py setup")] if "COPY" in line]
    assert copied == ["requirements/", "tools/dev.py"]
