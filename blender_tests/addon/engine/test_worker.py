"""Engine jobs against a stand-in engine: every way a job can end is seen, named and cleaned up."""

import json
import os
import sys
import time
from pathlib import Path

import pytest


def run(addon, tmp_path, behave="", stage="geometry", python=None, threads=0, **options):
    """A worker that begins a job of the fake engine."""
    capture = options.pop("capture", "nowhere")
    request = addon.engine_api.Request(stage, tmp_path / "project", {"behave": behave, "capture": capture})
    worker = addon.worker.Worker(**options)
    worker.begin(python or Path(sys.executable), request, tmp_path / "job", threads)
    return worker


def until_ended(worker, seconds=20):
    events, deadline = [], time.monotonic() + seconds
    while not worker.ended:
        events += worker.poll()
        assert time.monotonic() < deadline, "the job does not end"
        time.sleep(0.02)
    return events


def test_a_job_reports_hello_progress_and_done(addon, tmp_path, capture_folder):
    worker = run(addon, tmp_path, capture=str(capture_folder), threads=3)
    kinds = [event.kind for event in until_ended(worker)]
    assert kinds == ["hello", "stage", "progress", "warning", "done"]
    worker.check()
    assert (tmp_path / "job" / "engine.log").read_text() == "threads: 3\n"


def test_an_error_event_becomes_the_same_error_here(addon, tmp_path):
    worker = run(addon, tmp_path, "error")
    until_ended(worker)
    with pytest.raises(addon.engine_api.DataError, match=r"photo_7.png is missing\.") as caught:
        worker.check()
    assert caught.value.hint == "Find it."


def test_a_missing_torch_is_a_missing_dependency(addon, tmp_path):
    worker = run(addon, tmp_path, "no torch")
    until_ended(worker)
    with pytest.raises(addon.engine_api.MissingDependency, match="torch is not installed"):
        worker.check()


def test_a_crash_is_one_sentence_that_names_the_signal(addon, tmp_path):
    worker = run(addon, tmp_path, "crash")
    until_ended(worker)
    with pytest.raises(addon.engine_api.KarfError, match="crashed in the geometry job") as caught:
        worker.check()
    assert "SIGABRT" in caught.value.sentence or os.name == "nt"
    assert "something native went wrong" not in str(caught.value) and "\n" not in str(caught.value)
    assert addon.failures.log_tail(worker.folder) == "something native went wrong"


def test_a_silent_engine_is_ended_at_the_hello_deadline(addon, tmp_path):
    worker = run(addon, tmp_path, "silent", hello_seconds=0.5)
    until_ended(worker, 10)
    with pytest.raises(addon.engine_api.MissingDependency, match="did not answer"):
        worker.check()


def test_a_python_that_does_not_exist_is_a_missing_dependency(addon, tmp_path):
    with pytest.raises(addon.engine_api.MissingDependency, match="cannot be started"):
        run(addon, tmp_path, python=tmp_path / "no_python")


def test_cancel_stops_the_engine_at_a_safe_point(addon, tmp_path):
    worker = run(addon, tmp_path, "wait for cancel")
    while not worker.poll():
        time.sleep(0.02)
    worker.cancel()
    until_ended(worker)
    with pytest.raises(addon.engine_api.Cancelled):
        worker.check()


def test_an_engine_that_ignores_cancel_is_ended_by_force(addon, tmp_path, monkeypatch):
    monkeypatch.setattr(addon.worker, "CANCEL_SECONDS", 0.2)
    worker = run(addon, tmp_path, "deaf")
    while not worker.poll():
        time.sleep(0.02)
    worker.cancel()
    until_ended(worker, 5)
    with pytest.raises(addon.engine_api.Cancelled, match="SIGTERM"):
        worker.check()


def test_end_leaves_no_process(addon, tmp_path):
    worker = run(addon, tmp_path, "deaf")
    worker.end()
    assert worker.ended
    assert worker._process.poll() is not None


def test_the_engine_does_not_inherit_what_belongs_to_blender(addon, tmp_path, monkeypatch, capture_folder):
    monkeypatch.setenv("PYTHONPATH", "/blender/python")
    monkeypatch.setenv("LD_LIBRARY_PATH", "/blender/lib")
    monkeypatch.setenv("CUDA_VISIBLE_DEVICES", "1")
    until_ended(run(addon, tmp_path, "environment", capture=str(capture_folder)))
    seen = json.loads((tmp_path / "job" / "environment.json").read_text())
    assert "PYTHONPATH" not in seen and "LD_LIBRARY_PATH" not in seen
    assert seen["CUDA_VISIBLE_DEVICES"] == "1"
