"""A worker from job to job: kept after one that is done, never after another, nor for other settings."""

import sys
import time
from pathlib import Path

import pytest


@pytest.fixture
def worker(addon):
    worker = addon.worker.Worker(keep_seconds=60)
    yield worker
    worker.end()


@pytest.fixture
def begin(addon, tmp_path, worker, capture_folder):
    """Begins the worker's next job, of the fake engine."""
    numbers = iter(range(100))

    def begin(behave="", threads=0, python=sys.executable):
        options = {"behave": behave, "capture": str(capture_folder)}
        request = addon.engine_api.Request("geometry", tmp_path / "project", options)
        worker.begin(Path(python), request, tmp_path / f"job_{next(numbers)}", threads)

    return begin


@pytest.fixture
def until_ended(worker):
    """Polls until the job has ended; gives the number of the process that did it."""

    def until_ended():
        events, deadline = [], time.monotonic() + 20
        while not worker.ended:
            events += worker.poll()
            assert time.monotonic() < deadline, "the job does not end"
            time.sleep(0.01)
        return next((event.get("pid") for event in events if event.get("pid")), None)

    return until_ended


@pytest.fixture
def do(begin, until_ended):
    """Begins a job and waits for its end; gives the number of the process that did it."""

    def do(*options, **more):
        begin(*options, **more)
        return until_ended()

    return do


def test_one_process_does_three_jobs_each_in_its_own_folder(worker, do):
    processes, folders = set(), set()
    for _ in range(3):
        processes.add(do())
        folders.add(worker.folder)
        worker.check()
    assert len(processes) == 1 and len(folders) == 3


def test_a_crash_fails_its_own_job_alone_and_a_fresh_process_does_the_next(addon, worker, do, tmp_path):
    process = do()
    worker.check()
    do("crash")
    with pytest.raises(addon.engine_api.KarfError, match="The engine crashed in the geometry job"):
        worker.check()
    project = addon.engine_api.Project(tmp_path / "project")
    assert project.geometry_file.exists() and project.finished("geometry")
    assert do() != process
    worker.check()


def test_a_job_that_fails_ends_its_process(addon, worker, do):
    do()
    do("error")
    with pytest.raises(addon.engine_api.DataError, match=r"photo_7.png is missing\."):
        worker.check()
    assert worker._process.poll() is not None
    do()
    worker.check()


def test_a_later_job_is_cancelled_as_a_first_one(addon, worker, begin, do, until_ended):
    process = do()
    begin("wait for cancel")
    while not worker.poll():
        time.sleep(0.01)
    worker.cancel()
    until_ended()
    with pytest.raises(addon.engine_api.Cancelled):
        worker.check()
    assert do() != process


def test_a_process_that_was_told_to_stop_when_its_job_was_done_takes_no_other(worker, begin, do, until_ended):
    begin()
    events = worker.folder / "events.jsonl"
    while not events.exists() or '"done"' not in events.read_text():
        time.sleep(0.01)
    worker.cancel()
    process = until_ended()
    worker.check()
    assert worker._process.poll() is not None
    assert do() != process


@pytest.mark.parametrize("change", ["threads", "python", "environment", "too long", "gone"])
def test_a_fresh_process_does_the_next_job_where_the_one_before_does_not_serve(
    worker, do, monkeypatch, tmp_path, change
):
    process = do()
    before, settings = worker._process, {}
    if change == "threads":
        settings["threads"] = 3
    elif change == "python":
        settings["python"] = tmp_path / "python"
        settings["python"].symlink_to(sys.executable)
    elif change == "environment":
        monkeypatch.setenv("CUDA_VISIBLE_DEVICES", "1")
    elif change == "too long":
        worker._waits_until = time.monotonic()
    else:
        before.kill()
        before.wait()
    assert do(**settings) != process and before.poll() is not None
    worker.check()


def test_a_kept_process_ends_with_its_worker(worker, do):
    do()
    assert worker._process.poll() is None
    worker.end()
    assert worker._process.poll() is not None
