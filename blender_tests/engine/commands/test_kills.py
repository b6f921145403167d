"""A job that is killed outright, and run again: the same files as if nothing had happened."""

import os
import re
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import pytest

torch = pytest.importorskip("torch")
pytest.importorskip("scipy")

from blender_tests.engine.conftest import ROOT, run_engine
from karf_engine.cli import main
from karf_engine.compute.progress import Progress
from karf_engine.errors import Cancelled, Diverged
from karf_engine.io.checkpoints import load_tensors
from karf_engine.project import Project
from karf_engine.project.state import without_stage, write_state

FEW = (
    'geometry.levels=[{"voxels": 16, "iterations": 60, "step": 1.0}, {"voxels": 20, "iterations": 60, "step": 1.0}]',
    "geometry.samples=4000",
    "geometry.max_rays=512",
)
SAVING_ALWAYS = """
import sys
from karf_engine.fields import fit
fit.CHECKPOINT_INTERVAL = 0.0
from karf_engine.cli import main
sys.exit(main(sys.argv[1:]))
"""


def geometry_command(still_life, folder):
    command = still_life.command(folder, *FEW)
    masks = command.index("--masks")
    return ["geometry", *command[1:masks], *command[masks + 2 :]]


def same_file(first, second):
    """Whether both hold the same tensors and facts."""
    schema = f"karf-{first.stem}/1"
    (a, facts), (b, other) = load_tensors(first, schema), load_tensors(second, schema)
    return facts == other and a.keys() == b.keys() and all(torch.equal(a[name], b[name]) for name in a)


def kill_once_saved(command, saved: Path, times: int):
    """Run the command line in a child process and kill it after it has saved this many times."""
    child = subprocess.Popen(
        [sys.executable, "-c", SAVING_ALWAYS, *map(str, command)],
        cwd=ROOT,
        env=os.environ | {"OMP_NUM_THREADS": "1"},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    seen = set()
    while child.poll() is None and len(seen) < times:
        with suppress(FileNotFoundError):
            seen.add(saved.stat().st_mtime_ns)
        time.sleep(0.005)
    child.kill()
    child.wait()
    assert len(seen) >= times


def test_a_killed_geometry_stage_gives_the_same_file_in_the_end(still_life, tmp_path):
    whole, killed = Project(tmp_path / "whole"), Project(tmp_path / "killed")
    assert main(geometry_command(still_life, whole.folder)) == 0
    assert not whole.checkpoint_file("geometry").exists()
    for _ in range(2):
        kill_once_saved(geometry_command(still_life, killed.folder), killed.checkpoint_file("geometry"), 20)
        assert killed.finished("geometry") is None
    done = run_engine(*geometry_command(still_life, killed.folder))
    assert done.returncode == 0, done.stderr
    begun = int(re.search(r"resuming at iteration (\d+) of 120", done.stderr).group(1))
    assert begun > 20  # the second job had resumed too
    assert same_file(whole.geometry_file, killed.geometry_file)
    assert killed.finished("geometry")["held_out"] == whole.finished("geometry")["held_out"]
    assert not killed.checkpoint_file("geometry").exists()


@pytest.mark.parametrize("stage", ["segmentation", "recoloring"])
def test_a_cancelled_head_resumes_to_the_same_file(copy, learned, stage, monkeypatch, capsys):
    write_state(copy.state_file, without_stage(copy.state(), stage))
    count, steps = Progress.step, []

    def cancel(progress, number=1, **metrics):
        count(progress, number, **metrics)
        steps.extend([1] if "loss" in metrics or "palette" in metrics else [])
        if len(steps) > 25:
            raise Cancelled("The test wants it.")

    masks = ["--masks", str(copy.masks_folder)] if stage == "segmentation" else []
    command = [stage, str(copy.folder), *masks, "--threads", "1"]
    with monkeypatch.context() as patch:
        patch.setattr(Progress, "step", cancel)
        assert main(command) == Cancelled.exit_code
    assert copy.checkpoint_file(stage).exists()
    assert main(command) == 0
    assert "resuming at iteration 26 of" in capsys.readouterr().err
    assert same_file(*(each.output(f"{stage}.safetensors") for each in (Project(learned.project), copy)))
    assert not copy.checkpoint_file(stage).exists()


def test_what_led_to_divergence_is_not_resumed(still_life, tmp_path, monkeypatch):
    def find_nothing(fit):
        assert Project(tmp_path).checkpoint_file("geometry").exists()
        raise Diverged("Nothing is solid.")

    monkeypatch.setattr("karf_engine.fields.fit.CHECKPOINT_INTERVAL", 0.0)
    monkeypatch.setattr("karf_engine.fields.voxels.fit.VoxelFit._pruned", find_nothing)
    assert main(geometry_command(still_life, tmp_path)) == Diverged.exit_code
    assert not Project(tmp_path).checkpoint_file("geometry").exists()
