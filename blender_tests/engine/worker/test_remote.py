"""The engine on another computer: a stand-in for ssh runs it here, where the shared folder has another path."""

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

pytestmark = pytest.mark.skipif(os.name == "nt", reason="the stand-ins are scripts with a first line")
SECONDS = 900  # only a hang takes as long: a machine may have much else to do
# -T -o BatchMode=yes HOST COMMAND
SSH = """#!/bin/sh
[ "$1 $2 $3" = "-T -o BatchMode=yes" ] || exit 2
[ "$4" = gpu ] || exit 255
cd / && exec sh -c "$5"
"""
# Python on the other computer, on which nothing can be opened by the paths that the caller uses
PYTHON = """#!{python}
import sys
if "-m" not in sys.argv:
    import os
    os.execv("{python}", sys.argv)
def refuse(event, told):
    if event == "open" and str(told[0]).startswith("{client}"):
        raise FileNotFoundError(2, "not on this computer", str(told[0]))
sys.addaudithook(refuse)
sys.path.insert(0, "{root}")
from karf_engine.cli import main
sys.exit(main(sys.argv[sys.argv.index("karf_engine") + 1:]))
"""


@dataclass(frozen=True)
class Computers:
    """client, server: the shared folder's path on each. local: a folder that is not shared."""

    client: Path
    server: Path
    local: Path

    def start(self, *arguments, host="gpu", share=None):
        """As Blender starts an engine's Python; the share is where the map says that it is."""
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

    def run_job(self, request, job=None, **where):
        """A job from its request to its end: exit code, events, what was said beside them."""
        job = job or self.client / "project" / "jobs" / "one"
        request.write(job)
        child = self.start("-I", "-B", "-u", "-X", "utf8", ROOT / "karf_engine", "run", job, **where)
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
    """The computers with the still life's capture and learned project on the share."""
    shutil.copytree(still_life.capture, computers.server / "capture")
    shutil.copytree(learned.project, computers.server / "project")
    return computers


def test_a_job_runs_there_and_its_events_and_photos_have_the_paths_of_here(shared):
    project = shared.client / "learned"
    settings = [*QUICK, 'geometry.levels=[{"voxels": 8, "iterations": 2, "step": 1.0}]']
    options = {"capture": str(shared.client / "capture"), "overrides": settings, "threads": 1}
    code, events, said = shared.run_job(Request("geometry", project, options), project / "jobs" / "one")
    assert (code, events[-1].kind) == (0, "done"), said
    paths = [event["path"] for event in events if event.get("path")]
    assert paths and all(path.startswith(str(project)) for path in paths)
    assert str(shared.client) not in Project(project).capture_file.read_text()
    shared.server.rename(shared.local / "film")  # only the path of here leads there
    shared.client.unlink()
    shared.client.symlink_to(shared.local / "film", target_is_directory=True)
    views = read_capture(Project(project)).views
    assert all(view.image.is_relative_to(shared.client / "capture") and view.image.is_file() for view in views)


def test_cancel_gets_there(shared):
    job, options = shared.client / "job", {"capture": str(shared.client / "capture"), "preset": "fast", "threads": 1}
    Request("geometry", shared.client / "slow", options).write(job)
    child = shared.start("-I", "-B", "-u", "-X", "utf8", ROOT / "karf_engine", "run", job)
    child.stdin.write("cancel\n")
    child.stdin.flush()
    assert child.wait(SECONDS) == 6
    assert [event.kind for event in EventReader(job).poll()][-1] == "cancelled"
    assert Project(shared.server / "slow").finished("geometry") is None


RENDER = {"views": "test"}


def test_a_computer_that_is_not_reached_is_named(shared):
    code, (event,), _ = shared.run_job(Request("render", shared.client / "project", RENDER), host="nowhere")
    assert (code, event.kind) == (255, "error") and "nowhere cannot be reached" in event["sentence"]


def test_a_share_that_is_not_there_is_named(shared):
    elsewhere = shared.local / "elsewhere"
    code, events, said = shared.run_job(Request("render", shared.client / "project", RENDER), share=elsewhere)
    assert code == 4 and "is not a job folder" in said
    assert str(elsewhere) in events[0]["sentence"] and "--map" in events[0]["hint"]


def test_what_lies_outside_the_share_is_refused_here_or_named_in_the_events(shared):
    request = Request("render", shared.client / "project", RENDER)
    code, events, said = shared.run_job(request, job=shared.local / "job")
    assert (code, events) == (2, []) and "lies in no folder that both computers share" in said
    masks = shared.local / "masks"
    code, events, _ = shared.run_job(Request("segmentation", shared.client / "project", {"masks": str(masks)}))
    assert (code, events[-1].kind) == (2, "error") and f"{masks} lies in no folder" in events[-1]["sentence"]


def test_the_doctor_there_is_asked_about_the_shared_folder(shared):
    asked = (ROOT / "karf_engine", "doctor", "--json", "--quick", "--folder", shared.client / "project")
    child = shared.start("-I", "-B", "-u", "-X", "utf8", *asked)
    said, errors = child.communicate(timeout=SECONDS)
    assert str(shared.server / "project") in said, errors
    assert str(shared.client) not in said


def test_whatever_python_is_told_gets_there_as_it_is(computers):
    child = computers.start("-I", "-c", "import sys; print(sys.argv[1:])", "a b", "$HOME", "it's", '"')
    assert child.communicate(timeout=60)[0].strip() == repr(["a b", "$HOME", "it's", '"'])
