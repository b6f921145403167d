"""Engine jobs against a stand-in engine: every way a job can end is seen, named and cleaned up."""

import json
import os
import sys
import time
from pathlib import Path

import pytest


def run(addon, tmp_path, behave="", stage="geometry", python=None, **options):
    """Start a job of the fake engine."""

    capture = options.pop("capture", "nowhere")
    request = addon.engine_api.Request(stage, tmp_path / "project", {"behave": behave, "capture": capture})
    return addon.jobs.start(
        python or Path(sys.executable), addon.engine_api.ENGINE_FOLDER, request, tmp_path / "job", **options
    )


def until_ended(job, seconds=20):
    events, deadline = [], time.monotonic() + seconds
    while not job.ended:
        events += job.poll()
        assert time.monotonic() < deadline, "the job does not end"
        time.sleep(0.02)
    return events


def test_a_job_reports_hello_progress_and_done(addon, tmp_path, capture_folder):
    job = run(addon, tmp_path, capture=str(capture_folder), threads=3)
    kinds = [event.kind for event in until_ended(job)]
    assert kinds == ["hello", "stage", "progress", "warning", "done"]
    job.check()
    assert (tmp_path / "job" / "engine.log").read_text() == "threads: 3\n"


def test_an_error_event_becomes_the_same_error_here(addon, tmp_path):
    job = run(addon, tmp_path, "error")
    until_ended(job)
    with pytest.raises(addon.engine_api.DataError, match=r"photo_7.png is missing\.") as caught:
        job.check()
    assert caught.value.hint == "Find it."


def test_a_missing_torch_is_a_missing_dependency(addon, tmp_path):
    job = run(addon, tmp_path, "no torch")
    until_ended(job)
    with pytest.raises(addon.engine_api.MissingDependency, match="torch is not installed"):
        job.check()


def test_a_crash_is_one_sentence_that_names_the_signal(addon, tmp_path):
    job = run(addon, tmp_path, "crash")
    until_ended(job)
    with pytest.raises(addon.engine_api.KarfError, match="crashed in the geometry job") as caught:
        job.check()
    assert "SIGABRT" in caught.value.sentence or os.name == "nt"
    assert "something native went wrong" not in str(caught.value) and "\n" not in str(caught.value)
    assert job.log_tail() == "something native went wrong"


def test_a_silent_engine_is_ended_at_the_hello_deadline(addon, tmp_path):
    job = run(addon, tmp_path, "silent", hello_seconds=0.5)
    until_ended(job, 10)
    with pytest.raises(addon.engine_api.MissingDependency, match="did not answer"):
        job.check()


def test_a_python_that_does_not_exist_is_a_missing_dependency(addon, tmp_path):
    with pytest.raises(addon.engine_api.MissingDependency, match="cannot be started"):
        run(addon, tmp_path, python=tmp_path / "no_python")


def test_cancel_stops_the_engine_at_a_safe_point(addon, tmp_path):
    job = run(addon, tmp_path, "wait for cancel")
    while not job.poll():
        time.sleep(0.02)
    job.cancel()
    until_ended(job)
    with pytest.raises(addon.engine_api.Cancelled):
        job.check()


def test_an_engine_that_ignores_cancel_is_ended_by_force(addon, tmp_path, monkeypatch):
    monkeypatch.setattr(addon.jobs, "CANCEL_SECONDS", 0.2)
    job = run(addon, tmp_path, "deaf")
    while not job.poll():
        time.sleep(0.02)
    job.cancel()
    until_ended(job, 5)
    with pytest.raises(addon.engine_api.Cancelled, match="SIGTERM"):
        job.check()


def test_terminate_leaves_no_process(addon, tmp_path):
    job = run(addon, tmp_path, "deaf")
    job.terminate()
    assert job.ended
    assert job._process.poll() is not None


def test_the_engine_does_not_inherit_what_belongs_to_blender(addon, tmp_path, monkeypatch, capture_folder):
    monkeypatch.setenv("PYTHONPATH", "/blender/python")
    monkeypatch.setenv("LD_LIBRARY_PATH", "/blender/lib")
    monkeypatch.setenv("CUDA_VISIBLE_DEVICES", "1")
    until_ended(run(addon, tmp_path, "environment", capture=str(capture_folder)))
    seen = json.loads((tmp_path / "job" / "environment.json").read_text())
    assert "PYTHONPATH" not in seen and "LD_LIBRARY_PATH" not in seen
    assert seen["CUDA_VISIBLE_DEVICES"] == "1"


# --- tasks ---------------------------------------------------------------------------------------------------------
@pytest.fixture
def project_scene(addon, scene, capture_folder, tmp_path):
    addon.headless.import_capture(capture_folder, tmp_path / "project")
    return scene


def failing(addon, scene, behave):
    request = addon.engine_api.Request("geometry", addon.folders.project_of(scene).folder, {"behave": behave})
    return addon.job_watch.Task("Trial", (request,), lambda request: None)


def test_in_background_mode_an_operator_blocks_and_raises_the_engines_sentence(bpy, addon, project_scene, capfd):
    assert bpy.ops.karf.learn_scene() == {"FINISHED"}
    assert "KaRF geometry: geometry" in capfd.readouterr().out
    project = addon.folders.project_of(project_scene)
    assert project.geometry_file.exists()
    project.capture_file.unlink()
    project_scene.karf.capture = "/nowhere"
    with pytest.raises(RuntimeError, match="crashed"):
        bpy.ops.karf.learn_scene()
    assert bpy.context.window_manager.karf_progress.error.startswith("The engine crashed")


def test_a_pretrained_nerf_goes_along_with_what_is_learned(addon, project_scene, tmp_path):
    assert addon.steps.learn_scene(project_scene).requests[0].options["nerf"] is None
    project_scene.karf.nerf = str(tmp_path / "200000.tar")
    assert addon.steps.learn_scene(project_scene).requests[0].options["nerf"] == str(tmp_path / "200000.tar")


def test_the_timer_runs_a_task_to_its_end_without_blocking(bpy, addon, project_scene):
    watch = addon.job_watch
    task = addon.steps.learn_scene(project_scene)
    watch._begin(task)
    progress = bpy.context.window_manager.karf_progress
    assert progress.running and progress.stage == "Learn Scene"
    fractions, deadline = set(), time.monotonic() + 20
    while watch._tick() is not None:
        fractions.add(progress.fraction)
        assert time.monotonic() < deadline
        time.sleep(0.02)
    assert not progress.running and progress.text == "done" and progress.error == ""
    assert 0.5 in fractions
    assert progress.warnings == "This is no real engine."


def test_the_timer_shows_a_failed_job_and_ends(bpy, addon, project_scene):
    watch = addon.job_watch
    watch._begin(failing(addon, project_scene, "error"))
    deadline = time.monotonic() + 20
    while watch._tick() is not None:
        assert time.monotonic() < deadline
        time.sleep(0.02)
    progress = bpy.context.window_manager.karf_progress
    assert (progress.error, progress.hint) == ("photo_7.png is missing.", "Find it.")
    assert not watch.is_running()


def test_a_fault_after_the_job_ends_the_task_and_is_not_hidden(bpy, addon, project_scene):
    def fault(request):
        raise ZeroDivisionError("ours")

    task = addon.job_watch.Task("Trial", addon.steps.learn_scene(project_scene).requests, fault)
    addon.job_watch._begin(task)
    with pytest.raises(ZeroDivisionError):
        deadline = time.monotonic() + 20
        while addon.job_watch._tick() is not None:
            assert time.monotonic() < deadline
            time.sleep(0.02)
    progress = bpy.context.window_manager.karf_progress
    assert not progress.running and "ours" in progress.error


def test_a_second_task_is_refused_while_one_runs_and_cancel_ends_it(bpy, addon, project_scene):
    watch = addon.job_watch
    watch._begin(failing(addon, project_scene, "wait for cancel"))
    with pytest.raises(addon.engine_api.BadRequest, match="busy: Trial"):
        watch.wait(addon.steps.learn_scene(project_scene))
    assert not bpy.ops.karf.learn_scene.poll()
    assert bpy.ops.karf.cancel() == {"FINISHED"}
    deadline = time.monotonic() + 20
    while watch._tick() is not None:
        assert time.monotonic() < deadline
        time.sleep(0.02)
    progress = bpy.context.window_manager.karf_progress
    # what the user asked for is no error
    assert progress.text.startswith("cancelled") and progress.error == ""


def test_a_file_saved_during_a_job_does_not_show_it_when_loaded(bpy, addon, scene, tmp_path):
    progress = bpy.context.window_manager.karf_progress
    progress.running, progress.error = True, "old"
    addon.headless.save(tmp_path / "shot.blend")
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "shot.blend"))
    progress = bpy.context.window_manager.karf_progress
    assert not progress.running and progress.error == ""


def test_disabling_the_extension_ends_the_job_and_its_timer(bpy, addon, project_scene):
    watch = addon.job_watch
    watch._begin(failing(addon, project_scene, "deaf"))
    job = watch._running[0].job
    bpy.app.timers.register(watch._tick, first_interval=60, persistent=True)
    watch.unregister()
    watch.register()
    assert job.ended and not bpy.app.timers.is_registered(watch._tick)


def test_steps_out_of_order_are_refused_in_words(bpy, addon, scene):
    assert not bpy.ops.karf.learn_scene.poll()
    with pytest.raises(addon.engine_api.BadRequest, match="no capture"):
        addon.headless.learn_scene()
    with pytest.raises(addon.engine_api.BadRequest, match="No masks"):
        addon.headless.segment()


# --- the engine's Python -------------------------------------------------------------------------------------------
def test_the_preference_wins_over_the_variable_and_that_over_the_checkout(addon, tmp_path, monkeypatch):
    find = addon.environment.find_python
    preferred, variable = tmp_path / "preferred", tmp_path / "variable"
    beside = tmp_path / ".venv" / "engine" / "bin" / "python"
    beside.parent.mkdir(parents=True)
    for path in (preferred, variable, beside):
        path.touch()
    monkeypatch.setattr(addon.engine_api, "ENGINE_FOLDER", tmp_path / "karf_engine")
    assert find(str(preferred), {"KARF_ENGINE_PYTHON": str(variable)}) == preferred
    assert find("", {"KARF_ENGINE_PYTHON": str(variable)}) == variable
    assert find("", {}) == beside
    beside.unlink()
    with pytest.raises(addon.engine_api.MissingDependency, match="No Python with PyTorch"):
        find("", {})
    with pytest.raises(addon.engine_api.MissingDependency, match="gone"):
        find(str(tmp_path / "gone"), {})


@pytest.mark.filterwarnings("ignore:.*blend relative")
@pytest.mark.parametrize("path", ["//python", "python", "./python", "tools/python"])
def test_a_path_that_depends_on_the_open_file_is_refused(bpy, addon, chosen, tmp_path, monkeypatch, path):
    """A stranger's .blend may have any program beside it."""
    (tmp_path / "python").write_text("")
    addon.headless.save(tmp_path / "shot.blend")
    monkeypatch.chdir(tmp_path)
    with pytest.raises(addon.engine_api.MissingDependency, match="whole path"):
        addon.environment.find_python("", {"KARF_ENGINE_PYTHON": path})
    chosen.engine_python = path
    with pytest.raises(addon.engine_api.MissingDependency, match="whole path"):
        addon.preferences.engine_python()
    with pytest.raises(RuntimeError, match="whole path"):
        bpy.ops.karf.examine_engine()


def test_a_python_without_torch_is_told_what_to_install(bpy, addon):
    found = addon.environment.examine(Path(sys.executable))
    assert "torch" in found.missing and "numpy" not in found.missing
    assert "pip install torch" in found.command
    with pytest.raises(RuntimeError, match="lacks torch"):
        bpy.ops.karf.examine_engine()


def test_something_that_is_no_python_is_named(addon, tmp_path):
    with pytest.raises(addon.engine_api.MissingDependency, match="does not run"):
        addon.environment.examine(tmp_path / "nothing")
