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


def start_job(job, *options):
    """As Blender does it: the folder of the engine, isolated, with a pipe as lifeline."""
    return subprocess.Popen(
        [sys.executable, "-I", str(ROOT / "karf_engine"), "run", str(job), *options],
        stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        stderr=(job / "engine.log").open("w"),
        text=True,
    )


def wait_for(job, kind, seconds=60):
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


def test_a_job_reports_hello_progress_artifacts_and_done(learned, tmp_path):
    options = {"views": "test", "out": str(tmp_path / "out"), "planes": False, "threads": 1}
    Request("render", learned.project, options).write(tmp_path / "job")
    child = start_job(tmp_path / "job")
    assert child.wait(60) == 0
    child.stdin.close()
    events = list(EventReader(tmp_path / "job").poll())
    kinds = [event.kind for event in events]
    assert kinds[0] == "hello" and kinds[-1] == "done" and {"stage", "progress", "artifact"} <= set(kinds)
    assert events[0]["protocol"] == 1 and events[0]["pid"] == child.pid
    last = [event for event in events if event.kind == "progress"][-1]
    assert last["step"] == last["total"] == 2
    assert (tmp_path / "job" / "engine.log").read_text() == ""
    assert len(list((tmp_path / "out" / "render").iterdir())) == 2


@pytest.mark.parametrize("how", ["word", "end of input"])
def test_a_job_stops_when_told_and_leaves_the_project_free(still_life, tmp_path, how):
    pytest.importorskip("torch")
    overrides = ["geometry.long_side=32", "geometry.samples=20000"]
    options = {"capture": str(still_life.capture), "overrides": overrides, "threads": 1}
    Request("geometry", tmp_path / "project", options).write(tmp_path / "job")
    child = start_job(tmp_path / "job")
    wait_for(tmp_path / "job", "progress")
    assert (tmp_path / "project" / "lock.json").exists()
    if how == "word":
        child.stdin.write("cancel\n")
        child.stdin.flush()
    else:
        child.stdin.close()
    assert child.wait(30) == 6
    child.stdin.close()
    last = list(EventReader(tmp_path / "job").poll())[-1]
    assert last.kind == "cancelled" and last.is_final
    project = Project(tmp_path / "project")
    assert not (project.folder / "lock.json").exists() and project.finished("geometry") is None


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
    monkeypatch.setattr(sys, "stdin", (tmp_path / "request.json").open())
    assert main(["run", str(tmp_path)]) == code
    last = list(EventReader(tmp_path).poll())[-1]
    assert last.kind == "error" and last["code"] == kind and last["sentence"] and last["hint"]


def test_a_job_folder_that_is_missing_is_named(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(sys, "stdin", io.StringIO())
    assert main(["run", str(tmp_path / "none")]) == 4
    assert f"error: {tmp_path / 'none'} is not a job folder." in capsys.readouterr().err


def render_job(learned, job, **options):
    Request("render", learned.project, {"views": "test", "out": str(job / "out"), "threads": 1} | options).write(job)
    return job


def test_a_child_that_waits_does_the_next_job_as_the_first(learned, tmp_path):
    first, second, third = (render_job(learned, tmp_path / name) for name in ("first", "second", "third"))
    render_job(learned, third, views="no such view")
    child = start_job(first, "--wait", "60")
    begun = wait_for(first, "done")
    child.stdin.write(folder_line(second) + "\n")
    child.stdin.flush()
    events = wait_for(second, "done")
    assert events[0]["pid"] == begun[0]["pid"] == child.pid
    assert [event.kind for event in events if event.kind != "progress"] == ["hello", "stage", "artifact", "done"]
    for frame in sorted((first / "out" / "render").iterdir()):
        assert (second / "out" / "render" / frame.name).read_bytes() == frame.read_bytes()
    assert child.poll() is None
    child.stdin.write(folder_line(third) + "\n")
    child.stdin.flush()
    assert wait_for(third, "error")[-1]["code"] == "data"
    assert child.wait(30) == 4
    child.stdin.close()


def test_one_process_does_a_job_answers_queries_and_does_the_next_job(learned, tmp_path):
    first, second = (render_job(learned, tmp_path / name) for name in ("first", "second"))
    Request(WARM, learned.project, {"threads": 1, "device": "cpu"}).write(tmp_path / "queries")
    view = read_capture(Project(learned.project)).views[-1].name
    child = start_job(first, "--wait", "60")
    begun = wait_for(first, "done")
    query = Query(1, "masks", {"project": str(learned.project), "view": view})
    child.stdin.write(f"{folder_line(tmp_path / 'queries')}\n{query.encode()}\n")
    child.stdin.flush()
    events = wait_for(tmp_path / "queries", "answer")
    assert all(Path(file).is_file() for file in events[-1]["masks"].values())
    child.stdin.write(f"{folder_line(second)}\n")
    child.stdin.flush()
    assert [event.kind for event in wait_for(tmp_path / "queries", "done")] == ["hello", "answer", "done"]
    assert events[0]["pid"] == begun[0]["pid"] == wait_for(second, "done")[0]["pid"]
    child.stdin.close()
    assert child.wait(30) == 0


@pytest.mark.parametrize("how", ["word", "end of input", "time"])
def test_a_child_that_waits_ends_when_told_or_when_no_job_comes(learned, tmp_path, how):
    job = render_job(learned, tmp_path / "job")
    child = start_job(job, "--wait", "0.1" if how == "time" else "60")
    wait_for(job, "done")
    if how == "word":
        child.stdin.write("cancel\n")
        child.stdin.flush()
    elif how == "end of input":
        child.stdin.close()
    assert child.wait(30) == 0
    child.stdin.close()


def places(child):
    """The current folder of a process, and where its standard output and error go."""
    own = Path(f"/proc/{child.pid}")
    return [str((own / name).readlink()) for name in ("cwd", "fd/1", "fd/2")]


@pytest.mark.skipif(not Path("/proc/self/fd").is_dir(), reason="this system does not say what a process holds")
def test_a_child_is_in_its_jobs_folder_and_log_and_leaves_both_while_it_waits(learned, still_life, tmp_path):
    pytest.importorskip("torch")
    first, job = render_job(learned, tmp_path / "first"), tmp_path / "job"
    overrides = ["geometry.long_side=32", "geometry.samples=20000"]
    options = {"capture": str(still_life.capture), "overrides": overrides, "threads": 1}
    Request("geometry", tmp_path / "project", options).write(job)
    child = start_job(first, "--wait", "60")
    wait_for(first, "done")
    end = time.monotonic() + 10
    while (waiting := places(child)) != [tempfile.gettempdir(), os.devnull, os.devnull]:
        assert time.monotonic() < end, waiting
    child.stdin.write(folder_line(job) + "\n")
    child.stdin.flush()
    wait_for(job, "progress")
    assert places(child) == [str(job), str(job / "engine.log"), str(job / "engine.log")]
    child.stdin.write("cancel\n")
    child.stdin.flush()
    assert child.wait(30) == 6
    child.stdin.close()
    assert list(EventReader(job).poll())[-1].kind == "cancelled"
