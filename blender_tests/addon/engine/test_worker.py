"""The engine's worker against a stand-in engine: every way a job can end is seen, named and cleaned up."""

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
    """A function that begins a job of the fake engine with a new worker, or with the given one."""
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
    """Poll until the job has ended; returns its events."""
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


def test_silent_engine_is_ended_after_a_while(addon, begin):
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
    """A pipe tells when the child, its last writer, has ended."""
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
    seen = json.loads((worker.folder / "environment.json").read_text())
    assert "PYTHONPATH" not in seen and "LD_LIBRARY_PATH" not in seen
    assert seen["CUDA_VISIBLE_DEVICES"] == "1"


# --- one process for several jobs ----------------------------------------------------------------------------------
@pytest.fixture
def kept(addon):
    """A worker whose process waits for the next job."""
    return addon.worker.Worker(keep_seconds=60)


@pytest.fixture
def do(begin, kept):
    """A function that begins a job of the kept worker, waits for its end, and returns the number of its process."""

    def do(behave="", **options):
        events = wait(begin(behave, kept, **options))
        return next((event["pid"] for event in events if event.get("pid")), None)

    return do


def test_one_process_does_three_jobs_each_in_its_own_folder(kept, do):
    processes, folders = set(), set()
    for _ in range(3):
        processes.add(do())
        folders.add(kept.folder)
        kept.check()
    assert len(processes) == 1 and len(folders) == 3


@pytest.mark.parametrize(
    ("behave", "error", "sentence"),
    [
        ("error", "DataError", r"^photo_7.png is missing\. Find it\.$"),
        ("no torch", "MissingDependency", r"^torch is not installed\. Install it\.$"),
        ("crash", "KarfError", rf"^The engine crashed in the geometry job \({ABORTED}\)\. See its log for details\.$"),
    ],
)
def test_failure_is_one_sentence_and_affects_only_its_own_job(addon, kept, do, tmp_path, behave, error, sentence):
    process = do()
    do(behave)
    with pytest.raises(getattr(addon.engine_api, error), match=sentence):
        kept.check()
    assert kept._process.poll() is not None
    project = addon.engine_api.Project(tmp_path / "project")
    assert project.geometry_file.exists() and project.finished("geometry")
    assert do() != process
    kept.check()


@pytest.mark.parametrize("is_first", [True, False])
def test_cancel_stops_a_job_at_a_safe_point_and_its_process_takes_no_other(addon, begin, kept, do, is_first):
    process = None if is_first else do()
    begin("wait for cancel", kept)
    wait_for_hello(kept)
    kept.cancel()
    wait(kept)
    with pytest.raises(addon.engine_api.Cancelled):
        kept.check()
    assert kept._process.poll() is not None
    assert do() != process


def test_process_cancelled_after_its_job_takes_no_other(begin, kept, do):
    begin("", kept)
    events = kept.folder / "events.jsonl"
    while not events.exists() or '"done"' not in events.read_text():
        time.sleep(0.01)
    kept.cancel()
    hello, *_ = wait(kept)
    kept.check()
    assert kept._process.poll() is not None
    assert do() != hello["pid"]


@pytest.mark.parametrize("change", ["threads", "python", "environment", "too long", "gone"])
def test_changed_settings_or_a_dead_process_start_a_new_one(kept, do, monkeypatch, tmp_path, change):
    process = do()
    before, settings = kept._process, {}
    if change == "threads":
        settings["threads"] = 3
    elif change == "python":
        settings["python"] = tmp_path / "python"
        settings["python"].symlink_to(sys.executable)
    elif change == "environment":
        monkeypatch.setenv("CUDA_VISIBLE_DEVICES", "1")
    elif change == "too long":
        kept._waits_until = time.monotonic()
    else:
        before.kill()
        before.wait()
    assert do(**settings) != process and before.poll() is not None
    kept.check()


@pytest.mark.parametrize("is_busy", [True, False])
def test_end_leaves_no_process(begin, kept, do, is_busy):
    if is_busy:
        begin("deaf", kept)
    else:
        do()
    assert kept._process.poll() is None
    kept.end()
    assert kept.ended and kept._process.poll() is not None
