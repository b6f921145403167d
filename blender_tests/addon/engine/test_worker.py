"""The engine's worker reports and cleans up however a job ends, shown on the fake engine."""

import itertools
import json
import os
import select
import sys
import time
from pathlib import Path

import pytest

ABORTED = "SIGABRT" if os.name == "posix" else "exit code .*"


@pytest.fixture
def begin(addon, tmp_path, capture_folder):
    """A function that starts a job of the fake engine in a new or the given worker."""
    workers, numbers = [], itertools.count()

    def begin(behave="", worker=None, threads=0, python=sys.executable, **options):
        workers.append(worker or addon.worker.Worker(**options))
        options = {"behave": behave, "capture": str(capture_folder)}
        request = addon.engine_api.Request("geometry", tmp_path / "project", options)
        workers[-1].begin(Path(python), request, tmp_path / f"job_{next(numbers)}", threads)
        return workers[-1]

    yield begin
    for worker in workers:
        worker.end()


def wait(worker, seconds=20):
    """Poll until the job ends; returns its events."""
    events, deadline = [], time.monotonic() + seconds
    while not worker.ended:
        events += worker.poll()
        assert time.monotonic() < deadline, "the job does not end"
        time.sleep(0.01)
    return events


def wait_for_hello(worker):
    while not worker.poll():
        time.sleep(0.01)


def test_a_job_reports_hello_progress_and_done(begin):
    worker = begin(threads=3)
    assert [event.kind for event in wait(worker)] == ["hello", "stage", "progress", "warning", "done"]
    worker.check()
    assert (worker.folder / "engine.log").read_text() == "threads: 3\n"


def test_silent_engine_is_ended_after_a_timeout(addon, begin):
    worker = begin("silent", hello_seconds=0.5)
    wait(worker)
    with pytest.raises(addon.engine_api.MissingDependency, match="did not answer"):
        worker.check()


def test_missing_python_and_unusable_folder_are_named(addon, begin, tmp_path):
    with pytest.raises(addon.engine_api.MissingDependency, match="no_python cannot be started"):
        begin(python=tmp_path / "no_python")
    (tmp_path / "file").touch()
    request = addon.engine_api.Request("geometry", tmp_path / "project")
    with pytest.raises(addon.engine_api.DataError, match="file"):
        addon.worker.Worker().begin(Path(sys.executable), request, tmp_path / "file" / "job")


def test_engine_that_ignores_cancel_is_terminated(addon, begin, monkeypatch):
    monkeypatch.setattr(addon.worker, "CANCEL_SECONDS", 0.2)
    worker = begin("deaf")
    wait_for_hello(worker)
    worker.cancel()
    wait(worker, 5)
    with pytest.raises(addon.engine_api.Cancelled, match="SIGTERM"):
        worker.check()


@pytest.mark.skipif(sys.platform == "win32", reason="process groups")
def test_children_of_the_engine_end_with_it(addon, begin, tmp_path, monkeypatch):
    """The pipe becomes readable when the child, its last writer, ends."""
    os.mkfifo(tmp_path / "pipe")
    reader = os.open(tmp_path / "pipe", os.O_RDONLY | os.O_NONBLOCK)
    script = f"import subprocess; subprocess.Popen(['sleep', '60'], stdout=open({str(tmp_path / 'pipe')!r}, 'w'))"
    (tmp_path / "engine").mkdir()
    (tmp_path / "engine" / "__main__.py").write_text(f"{script}; raise SystemExit(1)")
    monkeypatch.setattr(addon.engine_api, "ENGINE_FOLDER", tmp_path / "engine")
    worker = begin()
    wait(worker)
    with pytest.raises(addon.engine_api.KarfError, match="exit code 1"):
        worker.check()
    assert select.select([reader], [], [], 20)[0] == [reader]
    os.close(reader)


def test_engine_does_not_inherit_blenders_variables(begin, monkeypatch):
    monkeypatch.setenv("PYTHONPATH", "/blender/python")
    monkeypatch.setenv("LD_LIBRARY_PATH", "/blender/lib")
    monkeypatch.setenv("CUDA_VISIBLE_DEVICES", "1")
    worker = begin("environment")
    wait(worker)
    environment = json.loads((worker.folder / "environment.json").read_text())
    assert "PYTHONPATH" not in environment and "LD_LIBRARY_PATH" not in environment
    assert environment["CUDA_VISIBLE_DEVICES"] == "1"


@pytest.fixture
def kept(addon):
    """A worker whose process waits for another job."""
    return addon.worker.Worker(keep_seconds=60)


@pytest.fixture
def run_job(begin, kept):
    """A function that runs a job in the kept worker and returns the number of its process."""

    def run_job(behave="", **options):
        events = wait(begin(behave, kept, **options))
        return next((event["pid"] for event in events if event.get("pid")), None)

    return run_job


@pytest.mark.parametrize(
    ("behave", "error", "sentence"),
    [
        ("error", "DataError", r"^photo_7.png is missing\. Find it\.$"),
        ("no torch", "MissingDependency", r"^torch is not installed\. Install it\.$"),
        ("crash", "KarfError", rf"^The engine crashed in the geometry job \({ABORTED}\)\. See its log for details\.$"),
    ],
)
def test_failure_is_one_sentence_and_spares_other_jobs(addon, kept, run_job, tmp_path, behave, error, sentence):
    process = run_job()
    run_job(behave)
    with pytest.raises(getattr(addon.engine_api, error), match=sentence):
        kept.check()
    assert kept._process.poll() is not None
    project = addon.engine_api.Project(tmp_path / "project")
    assert project.geometry_file.exists() and project.finished("geometry")
    assert run_job() != process
    kept.check()


@pytest.mark.parametrize("is_first", [True, False])
def test_cancelled_process_takes_no_other_job(addon, begin, kept, run_job, is_first):
    process = None if is_first else run_job()
    begin("wait for cancel", kept)
    wait_for_hello(kept)
    kept.cancel()
    wait(kept)
    with pytest.raises(addon.engine_api.Cancelled):
        kept.check()
    assert kept._process.poll() is not None
    assert run_job() != process


def test_process_cancelled_after_its_job_takes_no_other(begin, kept, run_job):
    begin("", kept)
    events = kept.folder / "events.jsonl"
    while not events.exists() or '"done"' not in events.read_text():
        time.sleep(0.01)
    kept.cancel()
    hello, *_ = wait(kept)
    kept.check()
    assert kept._process.poll() is not None
    assert run_job() != hello["pid"]


@pytest.mark.parametrize("change", ["threads", "python", "environment", "too long", "gone"])
def test_changed_settings_or_dead_process_start_another(kept, run_job, monkeypatch, tmp_path, change):
    process = run_job()
    before, settings = kept._process, {}
    if change == "threads":
        settings = {"threads": 3}
    elif change == "python":
        settings = {"python": tmp_path / "python"}
        settings["python"].symlink_to(sys.executable)
    elif change == "environment":
        monkeypatch.setenv("CUDA_VISIBLE_DEVICES", "1")
    elif change == "too long":
        kept._waits_until = time.monotonic()
    else:
        before.kill()
        before.wait()
    assert run_job(**settings) != process and before.poll() is not None
    kept.check()


@pytest.mark.parametrize("is_busy", [True, False])
def test_end_leaves_no_process(begin, kept, run_job, is_busy):
    if is_busy:
        begin("deaf", kept)
    else:
        run_job()
    assert kept._process.poll() is None
    kept.end()
    assert kept.ended and kept._process.poll() is not None
