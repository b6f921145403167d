"""Engine jobs against a stand-in engine: every way a job can end is seen, named and cleaned up."""

import json
import os
import sys
import time
from pathlib import Path

import pytest


def run(addon, tmp_path, behave="", stage="geometry", python=None, **options):
    """Start a job of the fake engine."""

    capture = options.pop("capture", "nowhere")
    request = addon.engine_api.Request(stage, tmp_path / "project", {"behave": behave, "capture": capture})
    return addon.jobs.start(
        python or Path(sys.executable), addon.engine_api.ENGINE_FOLDER, request, tmp_path / "job", **options
    )


def until_ended(job, seconds=20):
    events, deadline = [], time.monotonic() + seconds
    while not job.ended:
        events += job.poll()
        assert time.monotonic() < deadline, "the job does not end"
        time.sleep(0.02)
    return events


def test_a_job_reports_hello_progress_and_done(addon, tmp_path, capture_folder):
    job = run(addon, tmp_path, capture=str(capture_folder), threads=3)
    kinds = [event.kind for event in until_ended(job)]
    assert kinds == ["hello", "stage", "progress", "warning", "done"]
    job.check()
    assert (tmp_path / "job" / "engine.log").read_text() == "threads: 3\n"


def test_an_error_event_becomes_the_same_error_here(addon, tmp_path):
    job = run(addon, tmp_path, "error")
    until_ended(job)
    with pytest.raises(addon.engine_api.DataError, match=r"photo_7.png is missing\.") as caught:
        job.check()
    assert caught.value.hint == "Find it."


def test_a_missing_torch_is_a_missing_dependency(addon, tmp_path):
    job = run(addon, tmp_path, "no torch")
    until_ended(job)
    with pytest.raises(addon.engine_api.MissingDependency, match="torch is not installed"):
        job.check()


def test_a_crash_is_one_sentence_that_names_the_signal(addon, tmp_path):
    job = run(addon, tmp_path, "crash")
    until_ended(job)
    with pytest.raises(addon.engine_api.KarfError, match="crashed in the geometry job") as caught:
        job.check()
    assert "SIGABRT" in caught.value.sentence or os.name == "nt"
    assert "something native went wrong" not in str(caught.value) and "\n" not in str(caught.value)
    assert job.log_tail() == "something native went wrong"


def test_a_silent_engine_is_ended_at_the_hello_deadline(addon, tmp_path):
    job = run(addon, tmp_path, "silent", hello_seconds=0.5)
    until_ended(job, 10)
    with pytest.raises(addon.engine_api.MissingDependency, match="did not answer"):
        job.check()


def test_a_python_that_does_not_exist_is_a_missing_dependency(addon, tmp_path):
    with pytest.raises(addon.engine_api.MissingDependency, match="cannot be started"):
        run(addon, tmp_path, python=tmp_path / "no_python")


def test_cancel_stops_the_engine_at_a_safe_point(addon, tmp_path):
    job = run(addon, tmp_path, "wait for cancel")
    while not job.poll():
        time.sleep(0.02)
    job.cancel()
    until_ended(job)
    with pytest.raises(addon.engine_api.Cancelled):
        job.check()


def test_an_engine_that_ignores_cancel_is_ended_by_force(addon, tmp_path, monkeypatch):
    monkeypatch.setattr(addon.jobs, "CANCEL_SECONDS", 0.2)
    job = run(addon, tmp_path, "deaf")
    while not job.poll():
        time.sleep(0.02)
    job.cancel()
    until_ended(job, 5)
    with pytest.raises(addon.engine_api.Cancelled, match="SIGTERM"):
        job.check()


def test_terminate_leaves_no_process(addon, tmp_path):
    job = run(addon, tmp_path, "deaf")
    job.terminate()
    assert job.ended
    assert job._process.poll() is not None


def test_the_engine_does_not_inherit_what_belongs_to_blender(addon, tmp_path, monkeypatch, capture_folder):
    monkeypatch.setenv("PYTHONPATH", "/blender/python")
    monkeypatch.setenv("LD_LIBRARY_PATH", "/blender/lib")
    monkeypatch.setenv("CUDA_VISIBLE_DEVICES", "1")
    until_ended(run(addon, tmp_path, "environment", capture=str(capture_folder)))
    seen = json.loads((tmp_path / "job" / "environment.json").read_text())
    assert "PYTHONPATH" not in seen and "LD_LIBRARY_PATH" not in seen
    assert seen["CUDA_VISIBLE_DEVICES"] == "1"
