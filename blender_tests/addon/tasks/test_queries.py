"""Queries: one worker for many, none that outlives the extension, and no error that is lost."""

import errno
import subprocess
import sys
from pathlib import Path

import pytest

from ..timers import run_to_end

ROOT = Path(__file__).parents[3]


def query(addon, scene, **options):
    """Query in background mode, where queries block; the answer's values."""
    answers = []
    addon.queries.send(scene, "echo", options, lambda found, values: answers.append((found, values)))
    ((found, values),) = answers
    assert found == scene
    return values


@pytest.fixture
def beside(bpy, addon, monkeypatch):
    """Queries as with an interface: they return at once. The tests are the timer."""
    started = []
    app = type("App", (), {"background": False, "timers": type("Timers", (), {
        "is_registered": staticmethod(lambda tick: tick in started),
        "register": staticmethod(lambda tick, **how: started.append(tick)),
    })})  # fmt: skip
    for module in (addon.queries, addon.session):
        monkeypatch.setattr(module, "bpy", type("Bpy", (), {"app": app, "types": bpy.types}))
    return started


def jobs_of(addon, scene):
    return sorted((addon.folders.project_of(scene).folder / "jobs").glob("*-warm"))


def test_one_process_answers_one_query_after_the_other_and_knows_the_project(addon, project_scene):
    first, second = query(addon, project_scene, side=96), query(addon, project_scene, side=192)
    assert (first["options"]["side"], second["options"]["side"]) == (96, 192)
    assert first["options"]["project"] == str(addon.folders.project_of(project_scene).folder)
    assert first["pid"] == second["pid"]


def test_what_a_blender_that_crashed_has_left_goes_with_the_next_worker(addon, project_scene):
    code = "import sys; from karf_engine.project import Project, jobs; jobs.new_job(Project(sys.argv[1]), 'warm')"
    command = [sys.executable, "-c", code, str(addon.folders.project_of(project_scene).folder)]
    subprocess.run(command, cwd=ROOT, check=True)
    (left,) = jobs_of(addon, project_scene)
    (left / "answer.npz").touch()
    query(addon, project_scene)
    (job,) = jobs_of(addon, project_scene)
    assert not (job / "answer.npz").exists()


def test_what_the_worker_refuses_is_raised_and_the_worker_stays(addon, project_scene):
    pid = query(addon, project_scene)["pid"]
    with pytest.raises(addon.engine_api.DataError, match=r"photo_7.png is missing\.") as caught:
        query(addon, project_scene, behave="refuse")
    assert caught.value.hint == "Find it."
    assert query(addon, project_scene)["pid"] == pid


def test_after_a_crash_those_who_wait_are_told_and_the_next_query_starts_a_fresh_worker(addon, project_scene):
    pid = query(addon, project_scene)["pid"]
    with pytest.raises(addon.engine_api.KarfError, match="The engine crashed in the warm job"):
        query(addon, project_scene, behave="crash")
    assert query(addon, project_scene)["pid"] != pid


def test_a_worker_that_had_just_ended_for_want_of_queries_is_followed_by_another(addon, project_scene):
    with pytest.raises(addon.engine_api.KarfError, match="exited before it answered"):  # the second one does the same
        query(addon, project_scene, behave="idle")
    assert query(addon, project_scene)["pid"]


def test_its_folder_is_there_while_it_lives_and_gone_with_it(addon, project_scene):
    query(addon, project_scene)
    assert len(jobs_of(addon, project_scene)) == 1
    addon.queries.stop()
    assert jobs_of(addon, project_scene) == []


def test_a_crash_leaves_its_log(addon, project_scene):
    with pytest.raises(addon.engine_api.KarfError):
        query(addon, project_scene, behave="crash")
    (folder,) = jobs_of(addon, project_scene)
    assert (folder / addon.engine_api.LOG_FILE).exists()


def test_a_scene_without_a_project_is_told_so(addon, scene):
    with pytest.raises(addon.engine_api.BadRequest, match="has no KaRF project"):
        query(addon, scene)


# --- beside the interface ------------------------------------------------------------------------------------------
def test_beside_the_interface_a_query_returns_at_once_and_a_timer_brings_the_answer(addon, project_scene, beside):
    answers = []
    addon.queries.send(project_scene, "echo", {}, lambda scene, values: answers.append(values))
    assert answers == [] and addon.queries.is_waiting("echo") and beside == [addon.queries._poll]
    run_to_end(addon.queries._poll)
    assert len(answers) == 1 and not addon.queries.is_waiting("echo")


def test_queries_that_wait_for_the_start_are_replaced_by_later_ones_of_their_kind(addon, project_scene, beside):
    answers = []
    for number in range(50):
        addon.queries.send(project_scene, "echo", {"n": number}, lambda scene, values: answers.append(values))
    run_to_end(addon.queries._poll)
    assert [values["options"]["n"] for values in answers] == [49]


def test_of_a_dropped_query_nothing_more_is_heard(addon, project_scene, beside):
    heard = []
    addon.queries.send(project_scene, "echo", {"behave": "drop"}, lambda *answer: heard.append(answer), heard.append)
    run_to_end(addon.queries._poll)
    assert heard == []


def test_an_answer_for_a_scene_with_another_project_is_not_handed_out(addon, project_scene, beside, tmp_path):
    heard = []
    addon.queries.send(project_scene, "echo", {}, lambda *answer: heard.append(answer), heard.append)
    project_scene.karf.project = str(tmp_path / "elsewhere")
    run_to_end(addon.queries._poll)
    assert heard == []


def test_an_error_that_nobody_takes_stands_in_the_panel(bpy, addon, project_scene, beside):
    addon.queries.send(project_scene, "echo", {"behave": "refuse"}, lambda *answer: None)
    run_to_end(addon.queries._poll)
    progress = bpy.context.window_manager.karf_progress
    assert (progress.error, progress.hint) == ("photo_7.png is missing.", "Find it.")


def test_an_error_in_what_follows_an_answer_is_told_too(addon, project_scene, beside):
    def refuse(scene, values):
        raise addon.engine_api.DataError("The planes are damaged.", "Try again.")

    errors = []
    addon.queries.send(project_scene, "echo", {}, refuse, errors.append)
    run_to_end(addon.queries._poll)
    assert [error.sentence for error in errors] == ["The planes are damaged."]


def test_a_disk_that_does_not_take_what_follows_an_answer_is_told_and_later_answers_still_come(
    addon, project_scene, beside
):
    def write(scene, values):
        raise OSError(errno.ENOSPC, "No space left on device", "mask.png")

    errors, answers = [], []
    addon.queries.send(project_scene, "echo", {}, write, errors.append)
    run_to_end(addon.queries._poll)
    assert len(errors) == 1 and "mask.png" in errors[0].sentence + errors[0].hint
    addon.queries.send(project_scene, "echo", {}, lambda scene, values: answers.append(values))
    run_to_end(addon.queries._poll)
    assert len(answers) == 1


def test_other_threads_in_the_preferences_start_another_worker(addon, project_scene, chosen):
    pid = query(addon, project_scene)["pid"]
    chosen.threads = 3
    try:
        assert query(addon, project_scene)["pid"] != pid
        assert len(jobs_of(addon, project_scene)) == 1
    finally:
        chosen.threads = 0


def test_disabling_the_extension_ends_the_worker(addon, project_scene):
    query(addon, project_scene)
    worker = addon.session.get(addon.queries.QueryWorker).worker
    addon.extension.unregister()
    addon.extension.register()
    assert worker.ended and worker._process.poll() is not None
