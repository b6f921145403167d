"""`openjd`, the reference program of Open Job Description, checks and runs bundles on this machine."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import karf_engine as karf
from blender_tests.engine.commands.farm.sequences import Sequence
from blender_tests.engine.conftest import QUICK
from karf_engine.project import STAGE_ORDER, Project

OPENJD = shutil.which("openjd", path=os.pathsep.join((str(Path(sys.executable).parent), os.environ.get("PATH", ""))))
pytestmark = pytest.mark.skipif(OPENJD is None, reason="openjd-cli is not installed")
# a Python that dies in its second frame, when its files are written but not yet recorded
DYING = f"""#!{sys.executable}
import os, signal, sys
engine, arguments = sys.argv[6], sys.argv[7:]
sys.path.insert(0, os.path.dirname(engine))
from karf_engine.cli import main
from karf_engine.export.finished_frames import FinishedFrames
record, recorded = FinishedFrames.record, []
def dying(self, frame, *values):
    if recorded:
        os.kill(os.getpid(), signal.SIGKILL)
    recorded.append(frame)
    record(self, frame, *values)
FinishedFrames.record = dying
sys.exit(main(arguments))
"""


def openjd(verb, bundle, *arguments, fails=False):
    """Run openjd, which must succeed or fail; returns its output."""
    command, environment = [OPENJD, verb, bundle / "template.json", *arguments], os.environ | {"OMP_NUM_THREADS": "1"}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=300)
    assert (done.returncode != 0) == fails, done.stdout + done.stderr
    return done.stdout


def pictures(folder):
    """The bytes of all files by path, except the record of finished frames."""
    files = [path for path in folder.rglob("*") if path.is_file() and path.suffix != ".jsonl"]
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in files}


@pytest.mark.skipif(os.name == "nt", reason="a script is not a program there, and no signal kills")
def test_rerun_after_killed_task_equals_a_single_run(learned, tmp_path):
    sequence = Sequence(learned.project, tmp_path, 12)
    sequence.render(tmp_path / "single")
    chosen = {"views": str(sequence.cameras), "edit": sequence.edit, "per_task": 3, "threads": 1}
    bundle = karf.render_bundle(learned.project, tmp_path / "bundle", **chosen).rename(tmp_path / "farm")
    frames = bundle / "frames" / "recolor"
    assert "Total tasks: 4" in openjd("summary", bundle)
    dying = tmp_path / "dying_python"
    dying.write_text(DYING)
    dying.chmod(0o755)
    for first in (1, 4, 7, 10):
        python = dying if first == 4 else sys.executable
        words = ("--step", "Render", "--task-param", f"Frame={first}", "-p", f"EnginePython={python}")
        openjd("run", bundle, *words, fails=first == 4)
    assert len(pictures(frames)) == 11
    kept = (frames / "frame_0004.png").stat().st_mtime_ns
    openjd("run", bundle, "-p", f"EnginePython={sys.executable}")
    assert pictures(bundle / "frames") == pictures(tmp_path / "single")
    assert len(pictures(frames)) == 12 and (frames / "frame_0004.png").stat().st_mtime_ns == kept


def test_learning_bundle_learns_and_renders_a_capture(still_life, learned, tmp_path):
    few = ("segmentation.iterations=40", "recoloring.iterations=2", "splats.iterations=1")
    chosen = {"overrides": (*QUICK, *few), "views": "test", "per_task": 1, "threads": 1}
    bundle = karf.learning_bundle(still_life.capture, still_life.masks, tmp_path / "bundle", **chosen)
    bundle = bundle.rename(tmp_path / "farm")
    openjd("check", bundle)
    openjd("run", bundle, "--step", "Render", "--run-dependencies", "-p", f"EnginePython={sys.executable}")
    project = Project(bundle / "project")
    assert all(project.finished(stage) for stage in STAGE_ORDER)
    assert sorted(path.stem for path in (bundle / "frames" / "render").iterdir()) == ["test_r_0", "test_r_1"]
    assert project.geometry_file.read_bytes() == Project(learned.project).geometry_file.read_bytes()


def test_render_bundle_is_a_valid_template(learned, tmp_path):
    sequence = Sequence(learned.project, tmp_path, 3)
    photos = {"views": "test", "edit": sequence.edit, "depth": True}
    cameras = {"views": str(sequence.cameras), "edit": [sequence.edit] * 3}
    for name, options in (("photos", photos), ("cameras", cameras)):
        openjd("check", karf.render_bundle(learned.project, tmp_path / name, **options))
