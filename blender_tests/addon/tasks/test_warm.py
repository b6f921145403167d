"""Asks of the warm engine: one process for many, none that outlives the extension, and no error that is lost."""

import errno

import pytest

from ..timers import run_to_end


def ask(addon, scene, **options):
    """Ask in background mode, where asks block; the answer's values."""
    answers = []
    addon.warm.ask(scene, "echo", options, lambda found, values: answers.append((found, values)))
    ((found, values),) = answers
    assert found == scene
    return values


@pytest.fixture
def beside(bpy, addon, monkeypatch):
    """Asks as with an interface: they return at once. The tests are the timer."""
    started = []
    app = type("App", (), {"background": False, "timers": type("Timers", (), {
        "is_registered": staticmethod(lambda tick: tick in started),
        "register": staticmethod(lambda tick, **how: started.append(tick)),
    })})  # fmt: skip
    monkeypatch.setattr(addon.warm, "bpy", type("Bpy", (), {"app": app, "types": bpy.types}))
    return started


def jobs_of(addon, scene):
    return sorted((addon.folders.project_of(scene).folder / "jobs").glob("*-warm"))


def test_one_process_answers_one_ask_after_the_other_and_knows_the_project(addon, project_scene):
    first, second = ask(addon, project_scene, side=96), ask(addon, project_scene, side=192)
    assert (first["options"]["side"], second["options"]["side"]) == (96, 192)
    assert first["options"]["project"] == str(addon.folders.project_of(project_scene).folder)
    assert first["pid"] == second["pid"]


def test_what_the_engine_refuses_is_raised_and_the_engine_stays(addon, project_scene):
    pid = ask(addon, project_scene)["pid"]
    with pytest.raises(addon.engine_api.DataError, match=r"photo_7.png is missing\.") as caught:
        ask(addon, project_scene, behave="refuse")
    assert caught.value.hint == "Find it."
    assert ask(addon, project_scene)["pid"] == pid


def test_after_a_crash_those_who_wait_are_told_and_the_next_ask_starts_a_fresh_engine(addon, project_scene):
    pid = ask(addon, project_scene)["pid"]
    with pytest.raises(addon.engine_api.KarfError, match="The engine crashed in the warm job"):
        ask(addon, project_scene, behave="crash")
    assert ask(addon, project_scene)["pid"] != pid


def test_an_engine_that_had_just_ended_for_want_of_asks_is_followed_by_another(addon, project_scene):
    with pytest.raises(addon.engine_api.KarfError, match="ended before it answered"):  # the second one does the same
        ask(addon, project_scene, behave="idle")
    assert ask(addon, project_scene)["pid"]


def test_its_folder_is_there_while_it_lives_and_gone_with_it(addon, project_scene):
    ask(addon, project_scene)
    assert len(jobs_of(addon, project_scene)) == 1
    addon.warm.stop()
    assert jobs_of(addon, project_scene) == []


def test_a_crash_leaves_its_log(addon, project_scene):
    with pytest.raises(addon.engine_api.KarfError):
        ask(addon, project_scene, behave="crash")
    (folder,) = jobs_of(addon, project_scene)
    assert (folder / addon.engine_api.LOG_FILE).exists()


def test_a_scene_without_a_project_is_told_so(addon, scene):
    with pytest.raises(addon.engine_api.BadRequest, match="has no KaRF project"):
        ask(addon, scene)


# --- beside the interface ------------------------------------------------------------------------------------------
def test_beside_the_interface_an_ask_returns_at_once_and_a_timer_brings_the_answer(addon, project_scene, beside):
    answers = []
    addon.warm.ask(project_scene, "echo", {}, lambda scene, values: answers.append(values))
    assert answers == [] and addon.warm.is_waiting("echo") and beside == [addon.warm._tick]
    run_to_end(addon.warm._tick)
    assert len(answers) == 1 and not addon.warm.is_waiting("echo")


def test_asks_that_wait_for_the_start_are_replaced_by_later_ones_of_their_kind(addon, project_scene, beside):
    answers = []
    for number in range(50):
        addon.warm.ask(project_scene, "echo", {"n": number}, lambda scene, values: answers.append(values))
    run_to_end(addon.warm._tick)
    assert [values["options"]["n"] for values in answers] == [49]


def test_of_a_dropped_ask_nothing_more_is_heard(addon, project_scene, beside):
    heard = []
    addon.warm.ask(project_scene, "echo", {"behave": "drop"}, lambda *answer: heard.append(answer), heard.append)
    run_to_end(addon.warm._tick)
    assert heard == []


def test_an_answer_for_a_scene_with_another_project_is_not_handed_out(addon, project_scene, beside, tmp_path):
    heard = []
    addon.warm.ask(project_scene, "echo", {}, lambda *answer: heard.append(answer), heard.append)
    project_scene.karf.project = str(tmp_path / "elsewhere")
    run_to_end(addon.warm._tick)
    assert heard == []


def test_an_error_that_nobody_takes_stands_in_the_panel(bpy, addon, project_scene, beside):
    addon.warm.ask(project_scene, "echo", {"behave": "refuse"}, lambda *answer: None)
    run_to_end(addon.warm._tick)
    progress = bpy.context.window_manager.karf_progress
    assert (progress.error, progress.hint) == ("photo_7.png is missing.", "Find it.")


def test_an_error_in_what_follows_an_answer_is_told_too(addon, project_scene, beside):
    def refuse(scene, values):
        raise addon.engine_api.DataError("The planes are damaged.", "Try again.")

    errors = []
    addon.warm.ask(project_scene, "echo", {}, refuse, errors.append)
    run_to_end(addon.warm._tick)
    assert [error.sentence for error in errors] == ["The planes are damaged."]


def test_a_disk_that_does_not_take_what_follows_an_answer_is_told_and_later_answers_still_come(
    addon, project_scene, beside
):
    def write(scene, values):
        raise OSError(errno.ENOSPC, "No space left on device", "mask.png")

    errors, answers = [], []
    addon.warm.ask(project_scene, "echo", {}, write, errors.append)
    run_to_end(addon.warm._tick)
    assert len(errors) == 1 and "mask.png" in errors[0].sentence + errors[0].hint
    addon.warm.ask(project_scene, "echo", {}, lambda scene, values: answers.append(values))
    run_to_end(addon.warm._tick)
    assert len(answers) == 1


def test_other_threads_in_the_preferences_start_another_engine(addon, project_scene, chosen):
    pid = ask(addon, project_scene)["pid"]
    chosen.threads = 3
    try:
        assert ask(addon, project_scene)["pid"] != pid
        assert len(jobs_of(addon, project_scene)) == 1
    finally:
        chosen.threads = 0


def test_disabling_the_extension_ends_the_engine(addon, project_scene):
    ask(addon, project_scene)
    engine = addon.warm._Memory.engine
    addon.warm.unregister()
    addon.warm.register()
    assert engine.ended and engine._job._process.poll() is not None
