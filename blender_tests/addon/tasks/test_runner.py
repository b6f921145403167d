"""Tasks: one at a time, by a timer or blocking in a script; each end is one sentence, and a report where it helps."""

import shutil

import pytest

from ..layout import Layout
from ..timers import run_to_end

DAMAGED = (
    '{"t": "progress", "n": 1, "time": 0}',
    '{"t": "progress", "n": 1, "time": 0, "stage": "geometry", "step": "a", "total": null}',
    '{"t": "progress", "n": 1, "time": 0, "stage": "geometry", "step": 1, "total": 2, "metrics": [1], "eta_s": "x"}',
    '{"t": "warning", "n": 1, "time": 0}',
    '{"t": "preview", "n": 1, "time": 0, "path": 7}',
    '{"t": ["stage"], "n": 1, "time": 0}',
    '{"t": "error", "n": 1, "time": 0}',
    "\x00\x00 not json",
)


@pytest.fixture
def begin(addon, project_scene):
    """A function that begins a task of the fake engine; returns the worker."""

    def begin(behave="", after=lambda request: None):
        folder = addon.folders.project_of(project_scene).folder
        options = {"behave": behave, "capture": str(addon.captures.path_of(project_scene))}
        request = addon.engine_api.Request("geometry", folder, options)
        task = addon.runner.Task("Trial", (request,), after, addon.runner.Owner.of(project_scene))
        addon.session.get(addon.runner.Runner).begin(task)
        return addon.session.get(addon.runner.Runner).worker

    return begin


@pytest.fixture
def end(bpy, addon, begin):
    """A function that begins a task and lets the timer run it to its end; returns the progress that is shown."""

    def end(*arguments):
        begin(*arguments)
        run_to_end(addon.runner._poll)
        assert not addon.runner.is_running()
        return bpy.context.window_manager.karf_progress

    return end


def drawn_status(bpy, addon):
    drawn = []
    addon.sidebar.draw_status(Layout(bpy, drawn), bpy.context)
    return drawn


def test_in_background_mode_an_operator_blocks_and_raises_the_engines_sentence(bpy, addon, project_scene, capfd):
    assert bpy.ops.karf.learn_scene() == {"FINISHED"}
    assert "KaRF geometry: geometry" in capfd.readouterr().out
    project = addon.folders.project_of(project_scene)
    assert project.geometry_file.exists()
    project.capture_file.unlink()
    (addon.captures.path_of(project_scene) / "transforms.json").unlink()  # which Blender has read before
    with pytest.raises(RuntimeError, match="crashed"):
        bpy.ops.karf.learn_scene()
    assert bpy.context.window_manager.karf_progress.error.startswith("The engine crashed")


def test_the_timer_runs_a_task_to_its_end_without_blocking(bpy, addon, project_scene):
    addon.session.get(addon.runner.Runner).begin(addon.steps.learn_scene(project_scene))
    progress = bpy.context.window_manager.karf_progress
    assert progress.running and progress.stage == "Learn Scene"
    run_to_end(addon.runner._poll)
    assert (progress.running, progress.text, progress.error, progress.fraction) == (False, "done", "", 0.5)
    assert progress.warnings == "This is not a real engine."


def test_technical_warnings_are_not_shown(bpy, addon):
    for code, sentence in (("convergence", "A residual is left."), ("lacking", "Nothing belongs to 'lid'.")):
        event = addon.engine_api.Event("warning", 1, 0.0, {"code": code, "sentence": sentence})
        addon.progress.show_event("Learn All", event)
    assert bpy.context.window_manager.karf_progress.warnings == "Nothing belongs to 'lid'."


def test_a_second_task_is_refused_while_one_runs_and_cancel_ends_it(bpy, addon, project_scene, begin):
    begin("wait for cancel")
    with pytest.raises(addon.engine_api.BadRequest, match="busy: Trial"):
        addon.runner.wait(addon.steps.learn_scene(project_scene))
    assert not bpy.ops.karf.learn_scene.poll()
    assert bpy.ops.karf.cancel() == {"FINISHED"}
    run_to_end(addon.runner._poll)
    progress = bpy.context.window_manager.karf_progress
    assert progress.text.startswith("cancelled") and progress.error == ""  # what the user asked for is no error


def test_a_file_saved_during_a_job_does_not_show_it_when_loaded(bpy, addon, scene, tmp_path):
    progress = bpy.context.window_manager.karf_progress
    progress.running, progress.error = True, "old"
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "shot.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "shot.blend"))
    progress = bpy.context.window_manager.karf_progress
    assert not progress.running and progress.error == ""


def test_one_process_runs_several_jobs_and_waits_for_more(addon, project_scene, tmp_path):
    (tmp_path / "masks" / "pot").mkdir(parents=True)
    addon.steps.learn_scene(project_scene).wait()
    addon.steps.segment(project_scene, tmp_path / "masks").wait()
    addon.steps.extract_palette(project_scene).wait()
    jobs = (addon.folders.project_of(project_scene).folder / "jobs").iterdir()
    hellos = [next(iter(addon.engine_api.EventReader(job).poll())) for job in jobs]
    assert len(hellos) == 5 and len({hello["pid"] for hello in hellos}) == 1
    assert addon.session.get(addon.runner.Runner).worker._process.poll() is None


def test_disabling_the_extension_ends_the_job_and_its_timer(bpy, addon, begin):
    worker = begin("deaf")
    addon.session.start_timer(addon.runner._poll)
    addon.extension.unregister()
    addon.extension.register()
    assert worker.ended and worker._process.poll() is not None
    assert not addon.runner.is_running() and not bpy.app.timers.is_registered(addon.runner._poll)


# --- failures ------------------------------------------------------------------------------------------------------
def test_a_crash_is_a_sentence_with_a_report_and_a_log(bpy, addon, end, capfd):
    progress = end("crash")
    assert progress.error.startswith("The engine crashed in the geometry job")
    assert "\n" not in progress.error + progress.hint and len(progress.error + progress.hint) < 200
    drawn = drawn_status(bpy, addon)
    assert {"karf.copy_report", "karf.open_log"} <= set(drawn)
    assert "something native went wrong" not in "".join(drawn)
    assert "something native went wrong" in capfd.readouterr().out  # who watches the console sees it
    assert bpy.ops.karf.open_log() == {"FINISHED"}
    assert "something native went wrong" in bpy.data.texts["KaRF log"].as_string()
    assert bpy.ops.karf.copy_report() == {"FINISHED"}
    bpy.ops.karf.dismiss()
    assert not bpy.ops.karf.copy_report.poll() and not bpy.ops.karf.open_log.poll()


def test_error_the_user_can_fix_has_no_report(bpy, addon, end):
    progress = end("error")
    assert (progress.error, progress.hint) == ("photo_7.png is missing.", "Find it.")
    assert not {"karf.copy_report", "karf.open_log"} & set(drawn_status(bpy, addon))


@pytest.mark.parametrize(
    ("damage", "sentence"), [("events", "crashed in the geometry job (SIG"), ("project", "was removed while")]
)
def test_damaged_events_are_passed_over_and_a_project_that_is_gone_is_named(
    bpy, addon, project_scene, begin, damage, sentence
):
    worker = begin("deaf")
    if damage == "events":
        (worker.folder / "events.jsonl").write_text("".join(f"{line}\n" for line in DAMAGED))
    else:
        shutil.rmtree(addon.folders.project_of(project_scene).folder)
    assert addon.runner._poll() is not None
    worker.end()
    run_to_end(addon.runner._poll)
    assert sentence in bpy.context.window_manager.karf_progress.error


def test_a_folder_that_cannot_be_made_is_named(bpy, addon, project_scene, tmp_path):
    shutil.rmtree(tmp_path / "project")
    (tmp_path / "project").mkdir()
    (tmp_path / "project" / "jobs").touch()
    with pytest.raises(RuntimeError, match="project") as caught:
        bpy.ops.karf.learn_scene()
    assert "Traceback" not in str(caught.value)


def test_disk_error_after_a_job_is_reported(end):
    def full(request):
        raise OSError(28, "No space left on device", "/film/picture.png")

    assert end("", full).error == "/film/picture.png: No space left on device."


def test_bug_after_a_job_ends_the_task_and_is_raised(bpy, addon, end):
    def fault(request):
        raise ZeroDivisionError("ours")

    with pytest.raises(ZeroDivisionError):
        end("", fault)
    progress = bpy.context.window_manager.karf_progress
    assert not addon.runner.is_running() and not progress.running and "ours" in progress.error
