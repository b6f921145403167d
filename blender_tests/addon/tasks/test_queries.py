"""Queries share one worker, which ends with the extension, and report every error."""

import errno
import subprocess
import sys
from types import SimpleNamespace

import pytest

from ..conftest import ROOT
from ..timers import run_to_end


@pytest.fixture
def query(addon, project_scene):
    """A function that sends a query, which blocks in background mode, and returns the answer."""

    def query(**options):
        answers = []
        addon.queries.send(project_scene, "echo", options, lambda *answer: answers.append(answer))
        ((scene, values),) = answers
        assert scene == project_scene
        return values

    return query


@pytest.fixture
def jobs(addon, project_scene):
    """A function that lists the folders of the queries' workers."""
    return lambda: sorted((addon.folders.project_of(project_scene).folder / "jobs").glob("*-warm"))


def test_one_process_answers_all_queries_of_a_project(addon, project_scene, query):
    first, second = query(side=96), query(side=192)
    assert (first["options"]["side"], second["options"]["side"]) == (96, 192)
    assert first["options"]["project"] == str(addon.folders.project_of(project_scene).folder)
    assert first["pid"] == second["pid"]


def test_files_left_by_a_crashed_blender_are_removed(addon, project_scene, query, jobs):
    code = "import sys; from karf_engine.project import Project, jobs; jobs.new_job(Project(sys.argv[1]), 'warm')"
    command = [sys.executable, "-c", code, str(addon.folders.project_of(project_scene).folder)]
    subprocess.run(command, cwd=ROOT, check=True)
    (left,) = jobs()
    (left / "answer.npz").touch()
    query()
    (job,) = jobs()
    assert not (job / "answer.npz").exists()


@pytest.mark.parametrize(
    ("behave", "error", "sentence", "stays", "n_workers", "n_logs"),
    [
        ("refuse", "DataError", r"photo_7.png is missing\. Find it\.", True, 1, 1),
        ("crash", "KarfError", "The engine crashed in the warm job", False, 1, 1),  # its log is kept
        ("idle", "KarfError", "exited before it answered", False, 2, 0),
    ],
)
def test_dead_worker_is_replaced(addon, query, jobs, monkeypatch, behave, error, sentence, stays, n_workers, n_logs):
    started, begin_job = [], addon.queries.begin_job
    monkeypatch.setattr(addon.queries, "begin_job", lambda *args: (started.append(args), begin_job(*args)))
    pid = query()["pid"]
    with pytest.raises(getattr(addon.engine_api, error), match=sentence):
        query(behave=behave)
    assert len(started) == n_workers
    assert [(folder / addon.engine_api.LOG_FILE).exists() for folder in jobs()] == [True] * n_logs
    assert (query()["pid"] == pid) == stays


def test_scene_without_a_project_is_rejected(addon, scene):
    with pytest.raises(addon.engine_api.BadRequest, match="has no KaRF project"):
        addon.queries.send(scene, "echo", {}, lambda *answer: None)


def test_changed_thread_count_starts_another_worker(preferences, query, jobs):
    pid = query()["pid"]
    preferences.threads = 3
    assert query()["pid"] != pid and len(jobs()) == 1


def test_disabling_the_extension_ends_and_removes_the_worker(addon, query, jobs):
    query()
    worker = addon.session.get(addon.queries.QueryWorker).worker
    assert jobs() == [worker.folder]
    addon.extension.unregister()
    addon.extension.register()
    assert worker.ended and worker._process.poll() is not None and jobs() == []


@pytest.fixture
def timers(bpy, addon, monkeypatch):
    """The started timers. Queries return at once, as in a window, and the tests poll in the timers' place."""
    started = []
    timers = SimpleNamespace(is_registered=started.__contains__, register=lambda tick, **_: started.append(tick))
    in_window = SimpleNamespace(app=SimpleNamespace(background=False, timers=timers), types=bpy.types)
    for module in (addon.queries, addon.session):
        monkeypatch.setattr(module, "bpy", in_window)
    return started


@pytest.fixture
def send(addon, project_scene, timers):
    """A function that sends a query and returns the answers and errors so far."""
    results = SimpleNamespace(answers=[], errors=[])

    def send(on_answer=lambda scene, values: results.answers.append(values), **options):
        addon.queries.send(project_scene, "echo", options, on_answer, results.errors.append)
        return results

    return send


def test_query_returns_at_once_and_is_answered_by_timer(addon, send, timers):
    results = send()
    assert results.answers == [] and addon.queries.is_waiting("echo") and timers == [addon.queries._poll]
    run_to_end(addon.queries._poll)
    assert len(results.answers) == 1 and not addon.queries.is_waiting("echo")


def test_later_query_replaces_a_waiting_one_of_its_kind(addon, send):
    for number in range(50):
        results = send(n=number)
    run_to_end(addon.queries._poll)
    assert [values["options"]["n"] for values in results.answers] == [49] and results.errors == []


@pytest.mark.parametrize("lost", ["dropped by the engine", "of another project"])
def test_dropped_query_calls_no_callback(addon, project_scene, send, tmp_path, lost):
    results = send(behave="drop" if lost == "dropped by the engine" else "")
    if lost == "of another project":
        project_scene.karf.project = str(tmp_path / "elsewhere")
    run_to_end(addon.queries._poll)
    assert results.answers == results.errors == []


def test_unhandled_error_is_shown_in_the_panel(bpy, addon, project_scene, timers):
    addon.queries.send(project_scene, "echo", {"behave": "refuse"}, lambda *answer: None)
    run_to_end(addon.queries._poll)
    progress = bpy.context.window_manager.karf_progress
    assert (progress.error, progress.hint) == ("photo_7.png is missing.", "Find it.")


@pytest.mark.parametrize("sentence", ["The planes are damaged.", "mask.png: No space left on device."])
def test_callback_error_is_reported_and_later_answers_arrive(addon, send, sentence):
    def fail(scene, values):
        if sentence.startswith("mask.png"):
            raise OSError(errno.ENOSPC, "No space left on device", "mask.png")
        raise addon.engine_api.DataError(sentence, "Try again.")

    results = send(fail)
    run_to_end(addon.queries._poll)
    assert [error.sentence for error in results.errors] == [sentence]
    send()
    run_to_end(addon.queries._poll)
    assert len(results.answers) == 1
