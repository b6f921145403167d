"""Tasks run one at a time, by a timer or blocking in a script, and failures end in one sentence."""

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
    """A function that starts a task of the fake engine and returns its worker."""

    def begin(behave="", after=lambda request: None):
        folder = addon.folders.project_of(project_scene).folder
        options = {"behave": behave, "capture": str(addon.captures.path_of(project_scene))}
        request = addon.engine_api.Request("geometry", folder, options)
        runner = addon.session.get(addon.runner.Runner)
        runner.begin(addon.runner.Task("Trial", (request,), after, addon.runner.Owner.of(project_scene)))
        return runner.worker

    return begin


@pytest.fixture
def end(addon, begin):
    """A function that runs a task to its end by the timer and returns the progress shown."""

    def end(*arguments):
        begin(*arguments)
        run_to_end(addon.runner._poll)
        assert not addon.runner.is_running()
        return addon.progress.state()

    return end


def drawn_status(bpy, addon):
    drawn = []
    addon.sidebar.draw_status(Layout(bpy, drawn), bpy.context)
    return drawn


def test_operator_blocks_in_background_mode_and_raises_engine_errors(bpy, addon, project_scene, capfd):
    assert bpy.ops.karf.learn_scene() == {"FINISHED"}
    assert "KaRF geometry: geometry" in capfd.readouterr().out
    project = addon.folders.project_of(project_scene)
    assert project.geometry_file.exists()
    project.capture_file.unlink()
    (addon.captures.path_of(project_scene) / "transforms.json").unlink()  # Blender has read it before
    with pytest.raises(RuntimeError, match="crashed"):
        bpy.ops.karf.learn_scene()
    assert addon.progress.state().error.startswith("The engine crashed")


def test_timer_runs_a_task_without_blocking(addon, project_scene):
    addon.session.get(addon.runner.Runner).begin(addon.steps.learn_scene(project_scene))
    progress = addon.progress.state()
    assert progress.running and progress.stage == "Learn Scene"
    run_to_end(addon.runner._poll)
    assert (progress.running, progress.text, progress.error, progress.fraction) == (False, "done", "", 0.5)
    assert progress.warnings == "This is not a real engine."


def test_technical_warnings_are_not_shown(addon):
    for code, sentence in (("convergence", "A residual is left."), ("lacking", "Nothing belongs to 'lid'.")):
        event = addon.engine_api.Event("warning", 1, 0.0, {"code": code, "sentence": sentence})
        addon.progress.show_event("Learn All", event)
    assert addon.progress.state().warnings == "Nothing belongs to 'lid'."


def test_second_task_is_rejected_until_cancel_ends_the_first(bpy, addon, project_scene, begin):
    begin("wait for cancel")
    with pytest.raises(addon.engine_api.BadRequest, match="busy: Trial"):
        addon.runner.wait(addon.steps.learn_scene(project_scene))
    assert not bpy.ops.karf.learn_scene.poll()
    assert bpy.ops.karf.cancel() == {"FINISHED"}
    run_to_end(addon.runner._poll)
    progress = addon.progress.state()
    assert progress.text.startswith("cancelled") and progress.error == ""  # the user asked for it


def test_file_saved_during_a_job_loads_without_it(addon, reopen):
    progress = addon.progress.state()
    progress.running, progress.error = True, "old"
    reopen()
    progress = addon.progress.state()
    assert not progress.running and progress.error == ""


def test_one_process_runs_jobs_and_waits_for_more(addon, project_scene, tmp_path):
    (tmp_path / "masks" / "pot").mkdir(parents=True)
    addon.steps.learn_scene(project_scene).wait()
    addon.steps.segment(project_scene, tmp_path / "masks").wait()
    addon.steps.extract_palette(project_scene).wait()
    jobs = (addon.folders.project_of(project_scene).folder / "jobs").iterdir()
    hellos = [next(iter(addon.engine_api.EventReader(job).poll())) for job in jobs]
    assert len(hellos) == 5 and len({hello["pid"] for hello in hellos}) == 1
    assert addon.session.get(addon.runner.Runner).worker._process.poll() is None


def test_disabling_the_extension_ends_job_and_timer(bpy, addon, begin):
    worker = begin("deaf")
    addon.session.start_timer(addon.runner._poll)
    addon.extension.unregister()
    addon.extension.register()
    assert worker.ended and worker._process.poll() is not None
    assert not addon.runner.is_running() and not bpy.app.timers.is_registered(addon.runner._poll)


def test_crash_shows_one_sentence_with_report_and_log(bpy, addon, end, capfd):
    progress = end("crash")
    assert progress.error.startswith("The engine crashed in the geometry job")
    assert "\n" not in progress.error + progress.hint and len(progress.error + progress.hint) < 200
    drawn = drawn_status(bpy, addon)
    assert {"karf.copy_report", "karf.open_log"} <= set(drawn)
    assert "something native went wrong" not in "".join(drawn)
    assert "something native went wrong" in capfd.readouterr().out
    assert bpy.ops.karf.open_log() == {"FINISHED"}
    assert "something native went wrong" in bpy.data.texts["KaRF log"].as_string()
    assert bpy.ops.karf.copy_report() == {"FINISHED"}
    bpy.ops.karf.dismiss()
    assert not bpy.ops.karf.copy_report.poll() and not bpy.ops.karf.open_log.poll()


def test_error_that_the_user_can_fix_has_no_report(bpy, addon, end):
    progress = end("error")
    assert (progress.error, progress.hint) == ("photo_7.png is missing.", "Find it.")
    assert not {"karf.copy_report", "karf.open_log"} & set(drawn_status(bpy, addon))


@pytest.mark.parametrize("sentence", ["crashed in the geometry job (SIG", "was removed while"])
def test_damaged_events_are_skipped_and_missing_project_named(addon, project_scene, begin, sentence):
    worker = begin("deaf")
    if sentence.startswith("crashed"):
        (worker.folder / "events.jsonl").write_text("".join(f"{line}\n" for line in DAMAGED))
    else:
        shutil.rmtree(addon.folders.project_of(project_scene).folder)
    assert addon.runner._poll() is not None
    worker.end()
    run_to_end(addon.runner._poll)
    assert sentence in addon.progress.state().error


def test_job_folder_that_cannot_be_made_is_named(bpy, addon, project_scene, tmp_path):
    shutil.rmtree(tmp_path / "project")
    (tmp_path / "project").mkdir()
    (tmp_path / "project" / "jobs").touch()
    with pytest.raises(RuntimeError, match="project") as caught:
        bpy.ops.karf.learn_scene()
    assert "Traceback" not in str(caught.value)


def test_disk_error_after_a_job_is_shown(end):
    def fail(request):
        raise OSError(28, "No space left on device", "/film/picture.png")

    assert end("", fail).error == "/film/picture.png: No space left on device."


def test_bug_after_a_job_is_raised_and_ends_the_task(addon, end):
    def fail(request):
        raise ZeroDivisionError("ours")

    with pytest.raises(ZeroDivisionError):
        end("", fail)
    progress = addon.progress.state()
    assert not addon.runner.is_running() and not progress.running and "ours" in progress.error
