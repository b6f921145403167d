"""Job folders: the engine as a child process, its events, and how it stops."""

import io
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import pytest

from blender_tests.engine.conftest import ROOT
from karf_engine.cli import main
from karf_engine.project import Project
from karf_engine.project.contents import read_capture
from karf_engine.worker.protocol import WARM, EventReader, Query, Request, folder_line


@pytest.fixture
def start():
    """Start a job as Blender does: the engine's folder, isolated, with standard input as lifeline."""
    children = []

    def start(job, *options):
        command = [sys.executable, "-I", str(ROOT / "karf_engine"), "run", str(job), *options]
        log = (job / "engine.log").open("w")
        child = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=log, text=True)
        children.append(child)
        return child

    yield start
    for child in children:
        child.kill()
        child.wait()
        child.stdin.close()


def send(child, *lines):
    child.stdin.write("".join(f"{line}\n" for line in lines))
    child.stdin.flush()


def wait_for(job, kind, seconds=300):
    """The events up to the first of this kind."""
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


def frames_of(job):
    return {path.name: path.read_bytes() for path in (job / "out" / "render").iterdir()}


def test_one_process_runs_jobs_and_answers_queries(learned, tmp_path, start):
    first, second = (render_job(learned, tmp_path / name) for name in ("first", "second"))
    third = render_job(learned, tmp_path / "third", views="no such view")
    queries = tmp_path / "queries"
    Request(WARM, learned.project, {"threads": 1, "device": "cpu"}).write(queries)
    view = read_capture(Project(learned.project)).views[-1].name
    child = start(first, "--wait", "60")
    events = {first: wait_for(first, "done")}
    assert events[first][0]["protocol"] == 1 and (first / "engine.log").read_text() == ""
    last = [event for event in events[first] if event.kind == "progress"][-1]
    assert last["step"] == last["total"] == 2
    query = Query(1, "masks", {"project": str(learned.project), "view": view})
    send(child, folder_line(queries), query.encode())
    (answer,) = (event for event in wait_for(queries, "answer") if event.kind == "answer")
    assert all(Path(file).is_file() for file in answer["masks"].values())
    send(child, folder_line(second))
    events[second], events[queries] = wait_for(second, "done"), wait_for(queries, "done")
    assert [event.kind for event in events[queries]] == ["hello", "answer", "done"]
    for job in (first, second):
        kinds = [event.kind for event in events[job] if event.kind != "progress"]
        assert kinds == ["hello", "stage", "artifact", "done"]
    assert frames_of(second) == frames_of(first) and len(frames_of(first)) == 2
    assert {first_event["pid"] for first_event, *_ in events.values()} == {child.pid} and child.poll() is None

    send(child, folder_line(third))
    assert wait_for(third, "error")[-1]["code"] == "data"
    assert child.wait(30) == 4


@pytest.mark.parametrize("how", ["cancel", "end of input", "timeout"])
def test_waiting_process_ends_on_cancel_end_of_input_or_timeout(learned, tmp_path, how, start):
    job = render_job(learned, tmp_path / "job", views="test_r_0")
    child = start(job, "--wait", "0.1" if how == "timeout" else "60")
    wait_for(job, "done")
    if how == "cancel":
        send(child, "cancel")
    elif how == "end of input":
        child.stdin.close()
    assert child.wait(30) == 0


def places(child):
    """The current folder, standard output and standard error of a process; None where /proc is missing."""
    own = Path(f"/proc/{child.pid}")
    return [str((own / name).readlink()) for name in ("cwd", "fd/1", "fd/2")] if own.is_dir() else None


@pytest.mark.parametrize("how", ["cancel", "end of input"])
def test_cancelled_learning_job_releases_project_and_folder(learned, still_life, tmp_path, start, how):
    first, job, project = render_job(learned, tmp_path / "first"), tmp_path / "job", tmp_path / "project"
    overrides = ["geometry.long_side=32", "geometry.samples=20000"]
    options = {"capture": str(still_life.capture), "overrides": overrides, "threads": 1}
    Request("geometry", project, options).write(job)
    if how == "cancel":  # sent to a process that has left the folder of another job
        child = start(first, "--wait", "60")
        wait_for(first, "done")
        end = time.monotonic() + 10
        while (waiting := places(child)) not in ([tempfile.gettempdir(), os.devnull, os.devnull], None):
            assert time.monotonic() < end, waiting
        send(child, folder_line(job))
    else:
        child = start(job)
    wait_for(job, "progress")
    assert (project / "lock.json").exists()
    if how == "cancel":
        assert places(child) in ([str(job), str(job / "engine.log"), str(job / "engine.log")], None)
        send(child, "cancel")
    else:
        child.stdin.close()
    assert child.wait(30) == 6
    last = list(EventReader(job).poll())[-1]
    assert last.kind == "cancelled" and last.is_final
    assert not (project / "lock.json").exists() and Project(project).finished("geometry") is None


BAD_OPTIONS = [
    ({"threads": "2"}, "threads = '2' is not a whole number"),
    ({"views": ["r_0"]}, "views = ['r_0'] is not a text"),
    ({"out": 5}, "out = 5 is not a path"),
    ({"edit": [5]}, "edit = [5] is not a path or a list, each a path"),
    ({"overrides": "abc"}, "overrides = 'abc' is not a list, each a text"),
    ({"planes": "yes"}, "planes = 'yes' is not true or false"),
    ({"out": "a\0b"}, "holds a zero character"),
    ({"plane": True}, "Unknown option plane"),
]
BAD_JOBS = [  # changes to a request to render, exit code, error code, words
    (None, 4, "data", "is not a readable request"),
    ({"protocol": 9}, 2, "request", "speaks protocol 9"),
    ({"stage": "palette", "project": "/nowhere/at/all"}, 4, "data", "/nowhere/at/all is not a KaRF project"),
    ({"stage": "geometry"}, 2, "request", "capture"),
    ({"stage": "geometry", "options": {"capture": "c", "preset": "x"}}, 2, "request", "preset"),
    *(({"options": options}, 2, "request", words) for options, words in BAD_OPTIONS),
]


@pytest.mark.parametrize(("change", "code", "kind", "words"), BAD_JOBS)
def test_failed_job_ends_with_an_error_event(tmp_path, monkeypatch, change, code, kind, words):
    request = {"protocol": 1, "stage": "render", "project": str(tmp_path)}
    (tmp_path / "request.json").write_text("{" if change is None else json.dumps(request | change))
    monkeypatch.setattr(sys, "stdin", io.StringIO())
    assert main(["run", str(tmp_path)]) == code
    last = list(EventReader(tmp_path).poll())[-1]
    assert last.kind == "error" and last["code"] == kind and words in last["sentence"] and last["hint"]


def test_missing_job_folder_is_named(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(sys, "stdin", io.StringIO())
    assert main(["run", str(tmp_path / "none")]) == 4
    assert f"error: {tmp_path / 'none'} is not a job folder." in capsys.readouterr().err
