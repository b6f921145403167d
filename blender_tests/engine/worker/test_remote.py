"""Remote jobs: a stand-in for ssh runs the engine here, where the shared folder has another path."""

import os
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

from blender_tests.engine.conftest import QUICK, ROOT
from karf_engine.project import Project
from karf_engine.project.contents import read_capture
from karf_engine.worker.protocol import EventReader, Request

pytestmark = pytest.mark.skipif(os.name == "nt", reason="the stand-ins are shell scripts")
SECONDS = 900  # only a hang takes as long, even on a busy machine
ENGINE = ("-I", "-B", "-u", "-X", "utf8", ROOT / "karf_engine")
RENDER = {"views": "test"}
# -T -o BatchMode=yes HOST COMMAND
SSH = """#!/bin/sh
[ "$1 $2 $3" = "-T -o BatchMode=yes" ] || exit 2
[ "$4" = gpu ] || exit 255
cd / && exec sh -c "$5"
"""
# Python on the other computer, where nothing opens by the caller's paths
PYTHON = """#!{python}
import sys
if "-m" not in sys.argv:
    import os
    os.execv("{python}", sys.argv)
def reject(event, arguments):
    if event == "open" and str(arguments[0]).startswith("{client}"):
        raise FileNotFoundError(2, "not on this computer", str(arguments[0]))
sys.addaudithook(reject)
sys.path.insert(0, "{root}")
from karf_engine.cli import main
sys.exit(main(sys.argv[sys.argv.index("karf_engine") + 1:]))
"""


@dataclass(frozen=True)
class Computers:
    """The shared folder's path on each computer, and a folder that is not shared."""

    client: Path
    server: Path
    local: Path

    def start(self, *arguments, host="gpu", share=None):
        """Start the engine's Python as Blender does; `share` is the mapped path on the server."""
        return subprocess.Popen(
            [
                *(sys.executable, "-m", "karf_engine.remote", host, "--python", self.local / "python"),
                *("--map", f"{self.client}={share or self.server}", "--", *map(str, arguments)),
            ],
            env=os.environ | {"PATH": f"{self.local}:{os.environ['PATH']}", "OMP_NUM_THREADS": "1"},
            cwd=ROOT,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )

    def run_job(self, stage, options, project="project", job=None, **where):
        """Run a job on a project of the shared folder: exit code, events, standard error."""
        job = job or self.client / project / "jobs" / "one"
        Request(stage, self.client / project, options).write(job)
        child = self.start(*ENGINE, "run", job, **where)
        code = child.wait(SECONDS)
        return code, list(EventReader(job).poll()), child.stderr.read()


@pytest.fixture
def computers(tmp_path):
    server, client, local = tmp_path / "server" / "film", tmp_path / "client" / "the film", tmp_path / "local"
    for folder in (server, client.parent, local):
        folder.mkdir(parents=True)
    client.symlink_to(server, target_is_directory=True)
    for name, text in (("ssh", SSH), ("python", PYTHON.format(python=sys.executable, root=ROOT, client=client))):
        (local / name).write_text(text)
        (local / name).chmod(0o755)
    return Computers(client, server, local)


@pytest.fixture
def shared(computers, still_life, learned):
    """The computers with the still life's capture and learned project in the shared folder."""
    shutil.copytree(still_life.capture, computers.server / "capture")
    shutil.copytree(learned.project, computers.server / "project")
    return computers


def test_remote_job_reports_paths_of_this_computer(shared):
    project = shared.client / "learned"
    settings = [*QUICK, 'geometry.levels=[{"voxels": 8, "iterations": 2, "step": 1.0}]']
    options = {"capture": str(shared.client / "capture"), "overrides": settings, "threads": 1}
    code, events, errors = shared.run_job("geometry", options, "learned")
    assert (code, events[-1].kind) == (0, "done"), errors
    paths = [event["path"] for event in events if event.get("path")]
    assert paths and all(path.startswith(str(project)) for path in paths)
    assert str(shared.client) not in Project(project).capture_file.read_text()
    shared.server.rename(shared.local / "film")  # only the client's path leads there
    shared.client.unlink()
    shared.client.symlink_to(shared.local / "film", target_is_directory=True)
    views = read_capture(Project(project)).views
    assert all(view.image.is_relative_to(shared.client / "capture") and view.image.is_file() for view in views)


def test_cancel_reaches_the_remote_job(shared):
    job, options = shared.client / "job", {"capture": str(shared.client / "capture"), "preset": "fast", "threads": 1}
    Request("geometry", shared.client / "slow", options).write(job)
    child = shared.start(*ENGINE, "run", job)
    child.stdin.write("cancel\n")
    child.stdin.flush()
    assert child.wait(SECONDS) == 6
    assert [event.kind for event in EventReader(job).poll()][-1] == "cancelled"
    assert Project(shared.server / "slow").finished("geometry") is None


def test_unreachable_computer_is_named(shared):
    code, (event,), _ = shared.run_job("render", RENDER, host="nowhere")
    assert (code, event.kind) == (255, "error") and "nowhere cannot be reached" in event["sentence"]


def test_missing_shared_folder_is_named(shared):
    elsewhere = shared.local / "elsewhere"
    code, events, errors = shared.run_job("render", RENDER, share=elsewhere)
    assert code == 4 and "is not a job folder" in errors
    assert str(elsewhere) in events[0]["sentence"] and "--map" in events[0]["hint"]


def test_paths_outside_the_shared_folder_are_rejected(shared):
    code, events, errors = shared.run_job("render", RENDER, job=shared.local / "job")
    assert (code, events) == (2, []) and "lies in no folder that both computers share" in errors
    masks = shared.local / "masks"
    code, events, _ = shared.run_job("segmentation", {"masks": str(masks)})
    assert (code, events[-1].kind) == (2, "error") and f"{masks} lies in no folder" in events[-1]["sentence"]


def test_remote_doctor_checks_the_shared_folder(shared):
    child = shared.start(*ENGINE, "doctor", "--json", "--quick", "--folder", shared.client / "project")
    output, errors = child.communicate(timeout=SECONDS)
    assert str(shared.server / "project") in output, errors
    assert str(shared.client) not in output


def test_python_arguments_arrive_unchanged(computers):
    child = computers.start("-I", "-c", "import sys; print(sys.argv[1:])", "a b", "$HOME", "it's", '"')
    assert child.communicate(timeout=60)[0].strip() == repr(["a b", "$HOME", "it's", '"'])
