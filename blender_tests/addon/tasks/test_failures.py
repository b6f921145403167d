"""However a job ends, the user sees one sentence; what a developer needs is a button away, without private paths."""

import json
import shutil
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import pytest

from ..layout import Layout
from ..timers import run_to_end


def begin(addon, scene, behave, after=lambda request: None):
    request = addon.engine_api.Request("geometry", addon.folders.project_of(scene).folder, {"behave": behave})
    addon.session.get(addon.runner.Runner).begin(
        addon.runner.Task("Trial", (request,), after, addon.runner.Owner.of(scene))
    )
    return addon.session.get(addon.runner.Runner).worker


def drawn_status(bpy, addon):
    drawn = []
    context = SimpleNamespace(scene=bpy.context.scene, window_manager=bpy.context.window_manager)
    addon.sidebar.draw_status(Layout(bpy, drawn), context)
    return drawn


def test_a_crash_is_a_sentence_with_a_report_and_a_log(bpy, addon, project_scene, capfd):
    begin(addon, project_scene, "crash")
    run_to_end(addon.runner._poll)
    progress = bpy.context.window_manager.karf_progress
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


def test_what_a_user_can_mend_needs_no_report(bpy, addon, project_scene):
    begin(addon, project_scene, "error")
    run_to_end(addon.runner._poll)
    assert not {"karf.copy_report", "karf.open_log"} & set(drawn_status(bpy, addon))


def test_a_report_has_what_a_developer_needs_and_no_home_folder(addon, tmp_path, monkeypatch):
    home = tmp_path / "artist"
    job = home / "film" / "jobs" / "1"
    job.mkdir(parents=True)
    monkeypatch.setenv("HOME", str(home))
    monkeypatch.setenv("USERPROFILE", str(home))
    (job / "request.json").write_text(json.dumps({"stage": "geometry"}))
    (job / "events.jsonl").write_text(
        json.dumps({"t": "hello", "n": 0, "time": 1, "protocol": 1, "torch": "2.13"}) + "\n"
    )
    (job / "engine.log").write_text("early\n" * 50 + f"open({str(home / 'a.png')!r})\nlast line\n")
    versions = {"KaRF": "0.1", "Blender": "4.5", "Engine Python": str(home / "venv" / "python")}
    text = addon.failures.compose(job, "The engine crashed (SIGSEGV).", versions)
    for known in ("KaRF: 0.1", "Blender: 4.5", "System: ", "Stage: geometry", "torch 2.13", "SIGSEGV", "last line"):
        assert known in text
    assert str(home) not in text and "~" in text and text.count("early") < 30
    shutil.rmtree(job)
    assert "Log: \nnone" in addon.failures.compose(job, "It crashed.", versions)


@pytest.mark.parametrize("text", ["/home/ada", "/home/ada/x", "'/home/ada'", "a /home/ada: b", "/home/ada\nb"])
def test_a_home_folder_is_written_as_a_tilde(addon, text):
    assert "ada" not in addon.failures.without_home(text, "/home/ada")


def test_folders_of_other_names_stay(addon):
    assert addon.failures.without_home("/home/adam/x", "/home/ada") == "/home/adam/x"
    assert addon.failures.without_home("C:\\\\Users\\\\ada\\\\x", "C:\\Users\\ada") == "~\\\\x"
    assert addon.failures.without_home("/usr/bin", "/") == "/usr/bin"


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


def test_damaged_events_are_passed_over(bpy, addon, project_scene):
    worker = begin(addon, project_scene, "deaf")
    (worker.folder / "events.jsonl").write_text("".join(f"{line}\n" for line in DAMAGED))
    assert addon.runner._poll() is not None
    worker.end()
    run_to_end(addon.runner._poll)
    assert "crashed in the geometry job (SIG" in bpy.context.window_manager.karf_progress.error


def test_a_project_that_is_taken_away_under_a_job_is_said(bpy, addon, project_scene):
    worker = begin(addon, project_scene, "deaf")
    shutil.rmtree(addon.folders.project_of(project_scene).folder)
    assert addon.runner._poll() is not None
    worker.end()
    run_to_end(addon.runner._poll)
    assert "was removed while" in bpy.context.window_manager.karf_progress.error


def test_a_log_that_is_gone_hides_no_sentence(addon, project_scene):
    worker = begin(addon, project_scene, "crash")
    while not worker.ended:
        worker.poll()
        time.sleep(0.02)
    (worker.folder / "engine.log").unlink()
    with pytest.raises(addon.engine_api.KarfError, match="crashed in the geometry job"):
        worker.check()
    assert addon.failures.log_tail(worker.folder) == ""
    run_to_end(addon.runner._poll)


def test_a_folder_that_cannot_be_made_is_said(bpy, addon, project_scene, tmp_path):
    (tmp_path / "file").touch()
    request = addon.engine_api.Request("geometry", tmp_path / "project")
    with pytest.raises(addon.engine_api.DataError, match="file"):
        addon.worker.Worker().begin(Path(sys.executable), request, tmp_path / "file" / "job")
    shutil.rmtree(tmp_path / "project")
    (tmp_path / "project").mkdir()
    (tmp_path / "project" / "jobs").touch()
    with pytest.raises(RuntimeError, match="project") as caught:
        bpy.ops.karf.learn_scene()
    assert "Traceback" not in str(caught.value)


def test_what_the_disk_refuses_after_a_job_is_said(bpy, addon, project_scene):
    def full(request):
        raise OSError(28, "No space left on device", "/film/picture.png")

    request = addon.steps.learn_scene(project_scene).requests[0]
    addon.session.get(addon.runner.Runner).begin(
        addon.runner.Task("Trial", (request,), full, addon.runner.Owner.of(project_scene))
    )
    run_to_end(addon.runner._poll)
    assert bpy.context.window_manager.karf_progress.error == "/film/picture.png: No space left on device."


def test_an_operator_says_what_the_disk_refuses(bpy, addon, learned, tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(RuntimeError, match="file") as caught:
        bpy.ops.karf.save_edit(filepath=str(tmp_path / "file" / "edit.json"))
    assert "Traceback" not in str(caught.value)


@pytest.mark.skipif(sys.platform == "win32", reason="process groups")
def test_what_the_engine_has_started_ends_with_it(addon, tmp_path, monkeypatch):
    late = tmp_path / "late"
    (tmp_path / "engine").mkdir()
    script = f"import subprocess; subprocess.Popen(['sh', '-c', 'sleep 1; touch {late}']); raise SystemExit(1)"
    (tmp_path / "engine" / "__main__.py").write_text(script)
    request = addon.engine_api.Request("geometry", tmp_path / "project")
    monkeypatch.setattr(addon.engine_api, "ENGINE_FOLDER", tmp_path / "engine")
    worker = addon.worker.Worker()
    worker.begin(Path(sys.executable), request, tmp_path / "job")
    while not worker.ended:
        worker.poll()
        time.sleep(0.02)
    with pytest.raises(addon.engine_api.KarfError, match="exit code 1"):
        worker.check()
    time.sleep(1.2)
    assert not late.exists()


def test_cancel_says_that_the_step_resumes(bpy, addon):
    description = bpy.ops.karf.cancel.get_rna_type().description
    assert "Run the step again to resume it" in description
