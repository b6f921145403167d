"""The engine's process from job to job: kept after one that is done, never after another, nor for other settings."""

import sys
import time
from pathlib import Path

import pytest


@pytest.fixture
def kept(addon):
    engine = addon.keeping.KeptEngine()
    yield engine
    engine.end()


@pytest.fixture
def begin(addon, tmp_path, kept, capture_folder):
    """Starts the next job of the fake engine."""
    numbers = iter(range(100))

    def start(behave="", threads=0, python=sys.executable):
        options = {"behave": behave, "capture": str(capture_folder)}
        request = addon.engine_api.Request("geometry", tmp_path / "project", options)
        return kept.start(Path(python), request, tmp_path / f"job_{next(numbers)}", threads)

    return start


def ended(job):
    """The job, at its end, and the number of the process that did it."""
    events, deadline = [], time.monotonic() + 20
    while not job.ended:
        events += job.poll()
        assert time.monotonic() < deadline, "the job does not end"
        time.sleep(0.01)
    return job, next((event.get("pid") for event in events if event.get("pid")), None)


def test_one_process_does_three_jobs_each_in_its_own_folder(begin):
    jobs, processes = zip(*(ended(begin()) for _ in range(3)), strict=True)
    assert len(set(processes)) == 1 and len({job.folder for job in jobs}) == 3
    for job in jobs:
        job.check()


def test_a_crash_fails_its_own_job_alone_and_a_fresh_process_does_the_next(addon, begin, tmp_path):
    first, process = ended(begin())
    crashed, _ = ended(begin("crash"))
    first.check()
    with pytest.raises(addon.engine_api.KarfError, match="The engine crashed in the geometry job"):
        crashed.check()
    project = addon.engine_api.Project(tmp_path / "project")
    assert project.geometry_file.exists() and project.finished("geometry")
    last, fresh = ended(begin())
    last.check()
    assert fresh != process


def test_a_job_that_fails_ends_its_process(addon, begin):
    ended(begin())
    failed, _ = ended(begin("error"))
    with pytest.raises(addon.engine_api.DataError, match=r"photo_7.png is missing\."):
        failed.check()
    assert failed._process.poll() is not None
    last, _ = ended(begin())
    last.check()


def test_a_later_job_is_cancelled_as_a_first_one(addon, begin):
    _, process = ended(begin())
    job = begin("wait for cancel")
    while not job.poll():
        time.sleep(0.01)
    job.cancel()
    ended(job)
    with pytest.raises(addon.engine_api.Cancelled):
        job.check()
    assert ended(begin())[1] != process


def test_a_process_that_was_told_to_stop_when_its_job_was_done_takes_no_other(begin):
    job = begin()
    while not (job.folder / "events.jsonl").exists() or '"done"' not in (job.folder / "events.jsonl").read_text():
        time.sleep(0.01)
    job.cancel()
    _, process = ended(job)
    job.check()
    assert job._process.poll() is not None
    assert ended(begin())[1] != process


@pytest.mark.parametrize("change", ["threads", "python", "environment", "too long", "gone"])
def test_a_fresh_process_does_the_next_job_where_the_one_before_does_not_serve(
    begin, kept, monkeypatch, tmp_path, change
):
    before, process = ended(begin())
    settings = {}
    if change == "threads":
        settings["threads"] = 3
    elif change == "python":
        settings["python"] = tmp_path / "python"
        settings["python"].symlink_to(sys.executable)
    elif change == "environment":
        monkeypatch.setenv("CUDA_VISIBLE_DEVICES", "1")
    elif change == "too long":
        before._waits_until = time.monotonic()
    else:
        before._process.kill()
        before._process.wait()
    job, fresh = ended(begin(**settings))
    job.check()
    assert fresh != process and before._process.poll() is not None


def test_a_kept_process_ends_with_its_keeper(begin, kept):
    job, _ = ended(begin())
    assert job._process.poll() is None
    kept.end()
    assert job._process.poll() is not None
