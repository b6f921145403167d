"""Tasks: beside the interface by a timer, blocking in a script; one at a time, and none outlives the extension."""

import pytest

from ..timers import run_to_end


def failing(addon, scene, behave):
    request = addon.engine_api.Request("geometry", addon.folders.project_of(scene).folder, {"behave": behave})
    return addon.runner.Task("Trial", (request,), lambda request: None, addon.runner.Owner.of(scene))


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
    runner = addon.runner
    task = addon.steps.learn_scene(project_scene)
    addon.session.get(addon.runner.Runner).begin(task)
    progress = bpy.context.window_manager.karf_progress
    assert progress.running and progress.stage == "Learn Scene"
    run_to_end(runner._poll)
    assert not progress.running and progress.text == "done" and progress.error == ""
    assert progress.fraction == 0.5
    assert progress.warnings == "This is not a real engine."


def test_what_an_artist_can_do_nothing_about_stays_in_the_jobs_record(bpy, addon):
    progress = bpy.context.window_manager.karf_progress
    for code, sentence in (("convergence", "A residual is left."), ("lacking", "Nothing belongs to 'lid'.")):
        event = addon.engine_api.Event("warning", 1, 0.0, {"code": code, "sentence": sentence})
        addon.progress.show_event("Learn All", event)
    assert progress.warnings == "Nothing belongs to 'lid'."


def test_the_timer_shows_a_failed_job_and_ends(bpy, addon, project_scene):
    runner = addon.runner
    addon.session.get(addon.runner.Runner).begin(failing(addon, project_scene, "error"))
    run_to_end(runner._poll)
    progress = bpy.context.window_manager.karf_progress
    assert (progress.error, progress.hint) == ("photo_7.png is missing.", "Find it.")
    assert not runner.is_running()


def test_a_fault_after_the_job_ends_the_task_and_is_not_hidden(bpy, addon, project_scene):
    def fault(request):
        raise ZeroDivisionError("ours")

    requests, owner = addon.steps.learn_scene(project_scene).requests, addon.runner.Owner.of(project_scene)
    task = addon.runner.Task("Trial", requests, fault, owner)
    addon.session.get(addon.runner.Runner).begin(task)
    with pytest.raises(ZeroDivisionError):
        run_to_end(addon.runner._poll)
    progress = bpy.context.window_manager.karf_progress
    assert not progress.running and "ours" in progress.error


def test_a_second_task_is_refused_while_one_runs_and_cancel_ends_it(bpy, addon, project_scene):
    runner = addon.runner
    addon.session.get(addon.runner.Runner).begin(failing(addon, project_scene, "wait for cancel"))
    with pytest.raises(addon.engine_api.BadRequest, match="busy: Trial"):
        runner.wait(addon.steps.learn_scene(project_scene))
    assert not bpy.ops.karf.learn_scene.poll()
    assert bpy.ops.karf.cancel() == {"FINISHED"}
    run_to_end(runner._poll)
    progress = bpy.context.window_manager.karf_progress
    # what the user asked for is not an error
    assert progress.text.startswith("cancelled") and progress.error == ""


def test_a_file_saved_during_a_job_does_not_show_it_when_loaded(bpy, addon, scene, tmp_path):
    progress = bpy.context.window_manager.karf_progress
    progress.running, progress.error = True, "old"
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "shot.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "shot.blend"))
    progress = bpy.context.window_manager.karf_progress
    assert not progress.running and progress.error == ""


def test_one_process_runs_what_is_learned_in_a_row_and_ends_with_the_extension(bpy, addon, project_scene, tmp_path):
    (tmp_path / "masks" / "pot").mkdir(parents=True)
    addon.steps.learn_scene(project_scene).wait()
    addon.steps.segment(project_scene, tmp_path / "masks").wait()
    addon.steps.extract_palette(project_scene).wait()
    jobs = (addon.folders.project_of(project_scene).folder / "jobs").iterdir()
    hellos = [next(iter(addon.engine_api.EventReader(job).poll())) for job in jobs]
    assert len(hellos) == 5 and len({hello["pid"] for hello in hellos}) == 1
    process = addon.session.get(addon.runner.Runner).worker._process
    assert process.poll() is None
    addon.extension.unregister()
    addon.extension.register()
    assert process.poll() is not None


def test_disabling_the_extension_ends_the_job_and_its_timer(bpy, addon, project_scene):
    runner = addon.runner
    addon.session.get(addon.runner.Runner).begin(failing(addon, project_scene, "deaf"))
    addon.session.start_timer(runner._poll)
    worker = addon.session.get(addon.runner.Runner).worker
    addon.extension.unregister()
    addon.extension.register()
    assert worker.ended and worker._process.poll() is not None
    assert not runner.is_running() and not bpy.app.timers.is_registered(runner._poll)
