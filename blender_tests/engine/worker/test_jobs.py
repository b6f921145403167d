"""Job folders: the engine as a child process, its events, and how it is stopped."""

import io
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import pytest

pytest.importorskip("scipy")
pytest.importorskip("imageio")

from blender_tests.engine.conftest import ROOT
from karf_engine.cli import main
from karf_engine.project import Project
from karf_engine.project.contents import read_capture
from karf_engine.worker.protocol import WARM, EventReader, Query, Request, folder_line


@pytest.fixture
def start():
    """Start a job as Blender does it: the folder of the engine, isolated, with a pipe as lifeline."""
    children = []

    def start(job, *options):
        child = subprocess.Popen(
            [sys.executable, "-I", str(ROOT / "karf_engine"), "run", str(job), *options],
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=(job / "engine.log").open("w"),
            text=True,
        )
        children.append(child)
        return child

    yield start
    for child in children:
        child.kill()
        child.wait()
        child.stdin.close()


def tell(child, *lines):
    child.stdin.write("".join(f"{line}\n" for line in lines))
    child.stdin.flush()


def wait_for(job, kind, seconds=300):
    """Events up to the first of this kind."""
    reader, events = EventReader(job), []
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        for event in reader.poll():
            events.append(event)
            if event.kind == kind:
                return events
        time.sleep(0.02)
    raise AssertionError(f"no {kind} after {[e.kind for e in events]}: {(job / 'engine.log').read_text()}")


def render_job(learned, job, **options):
    Request("render", learned.project, {"views": "test", "out": str(job / "out"), "threads": 1} | options).write(job)
    return job


def learning_job(still_life, job, project):
    overrides = ["geometry.long_side=32", "geometry.samples=20000"]
    options = {"capture": str(still_life.capture), "overrides": overrides, "threads": 1}
    Request("geometry", project, options).write(job)
    return job


def frames_of(job):
    return {path.name: path.read_bytes() for path in (job / "out" / "render").iterdir()}


def test_one_process_does_jobs_and_answers_queries_as_they_come(learned, tmp_path, start):
    first, second, third = (render_job(learned, tmp_path / name) for name in ("first", "second", "third"))
    render_job(learned, third, views="no such view")
    queries = tmp_path / "queries"
    Request(WARM, learned.project, {"threads": 1, "device": "cpu"}).write(queries)
    view = read_capture(Project(learned.project)).views[-1].name
    child = start(first, "--wait", "60")
    events = {first: wait_for(first, "done")}
    assert events[first][0]["protocol"] == 1 and (first / "engine.log").read_text() == ""
    last = [event for event in events[first] if event.kind == "progress"][-1]
    assert last["step"] == last["total"] == 2

    query = Query(1, "masks", {"project": str(learned.project), "view": view})
    tell(child, folder_line(queries), query.encode())
    (answer,) = (event for event in wait_for(queries, "answer") if event.kind == "answer")
    assert all(Path(file).is_file() for file in answer["masks"].values())
    tell(child, folder_line(second))
    events[second] = wait_for(second, "done")
    events[queries] = wait_for(queries, "done")
    assert [event.kind for event in events[queries]] == ["hello", "answer", "done"]
    for job in (first, second):
        kinds = [event.kind for event in events[job] if event.kind != "progress"]
        assert kinds == ["hello", "stage", "artifact", "done"]
    assert frames_of(second) == frames_of(first) and len(frames_of(first)) == 2
    assert {told[0]["pid"] for told in events.values()} == {child.pid} and child.poll() is None

    tell(child, folder_line(third))
    assert wait_for(third, "error")[-1]["code"] == "data"
    assert child.wait(30) == 4


@pytest.mark.parametrize("how", ["word", "end of input", "time"])
def test_a_child_that_waits_ends_when_told_or_when_no_job_comes(learned, tmp_path, how, start):
    job = render_job(learned, tmp_path / "job", views="test_r_0")
    child = start(job, "--wait", "0.1" if how == "time" else "60")
    wait_for(job, "done")
    if how == "word":
        tell(child, "cancel")
    elif how == "end of input":
        child.stdin.close()
    assert child.wait(30) == 0


def check_cancelled(child, job, project):
    assert child.wait(30) == 6
    last = list(EventReader(job).poll())[-1]
    assert last.kind == "cancelled" and last.is_final
    assert not (project / "lock.json").exists() and Project(project).finished("geometry") is None


def test_a_job_stops_where_the_input_ends_and_leaves_the_project_free(still_life, tmp_path, start):
    pytest.importorskip("torch")
    job, project = tmp_path / "job", tmp_path / "project"
    child = start(learning_job(still_life, job, project))
    wait_for(job, "progress")
    assert (project / "lock.json").exists()
    child.stdin.close()
    check_cancelled(child, job, project)


def places(child):
    """The current folder of a process, and where its standard output and error go."""
    own = Path(f"/proc/{child.pid}")
    return [str((own / name).readlink()) for name in ("cwd", "fd/1", "fd/2")]


@pytest.mark.skipif(not Path("/proc/self/fd").is_dir(), reason="this system does not say what a process holds")
def test_a_child_is_in_its_jobs_folder_and_log_until_it_is_told_to_stop(learned, still_life, tmp_path, start):
    pytest.importorskip("torch")
    first, job, project = render_job(learned, tmp_path / "first"), tmp_path / "job", tmp_path / "project"
    learning_job(still_life, job, project)
    child = start(first, "--wait", "60")
    wait_for(first, "done")
    end = time.monotonic() + 10
    while (waiting := places(child)) != [tempfile.gettempdir(), os.devnull, os.devnull]:
        assert time.monotonic() < end, waiting
    tell(child, folder_line(job))
    wait_for(job, "progress")
    assert places(child) == [str(job), str(job / "engine.log"), str(job / "engine.log")]
    tell(child, "cancel")
    check_cancelled(child, job, project)


@pytest.mark.parametrize(
    ("request_text", "code", "kind"),
    [
        ("{", 4, "data"),
        ('{"protocol": 9, "stage": "palette", "project": "p"}', 2, "request"),
        ('{"protocol": 1, "stage": "geometry", "project": "p", "options": {}}', 2, "request"),
        ('{"protocol": 1, "stage": "palette", "project": "/nowhere/at/all"}', 4, "data"),
        (
            '{"protocol": 1, "stage": "geometry", "project": "p", "options": {"capture": "c", "preset": "x"}}',
            2,
            "request",
        ),
    ],
)
def test_a_job_that_fails_says_why_as_an_event(tmp_path, monkeypatch, request_text, code, kind):
    pytest.importorskip("torch")
    (tmp_path / "request.json").write_text(request_text)
    monkeypatch.setattr(sys, "stdin", io.StringIO(request_text))
    assert main(["run", str(tmp_path)]) == code
    last = list(EventReader(tmp_path).poll())[-1]
    assert last.kind == "error" and last["code"] == kind and last["sentence"] and last["hint"]


def test_a_job_folder_that_is_missing_is_named(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(sys, "stdin", io.StringIO())
    assert main(["run", str(tmp_path / "none")]) == 4
    assert f"error: {tmp_path / 'none'} is not a job folder." in capsys.readouterr().err
