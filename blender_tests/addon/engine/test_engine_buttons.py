"""The preferences choose the engine's Python and show its state; buttons install, repair and remove it."""

from pathlib import Path
from types import MethodType, SimpleNamespace

import pytest

from ..layout import Layout, drawn_preferences
from ..timers import run_to_end


@pytest.fixture
def engine(addon, monkeypatch, tmp_path):
    """A function that lets the preferences find an engine in some state."""

    def made(state, problem="", sentence="", is_managed=True):
        python = addon.home.python_of(tmp_path / "env") if is_managed else tmp_path / "another"
        found = addon.state.Engine(python, problem, tmp_path, addon.home.Status(state, sentence))
        monkeypatch.setattr(addon.state, "known", lambda: found)
        return found

    return made


class Planned:
    """A plan with what the buttons need of it."""

    def __init__(self, choices):
        self.choices, self.folder = choices, choices.folder
        self.sentences = (f"To {self.folder}.", "About 351 MB.")

    def commands(self, shell):
        return f"commands for {shell}"


@pytest.fixture
def launched(addon, monkeypatch):
    """A list of the launched plans; nothing is installed."""
    started = []
    monkeypatch.setattr(addon.installing, "plan", Planned)
    monkeypatch.setattr(addon.installing, "launch", started.append)
    return started


def dialog(bpy, **values):
    """The text of the dialog *Install Engine* with these values."""
    kind = bpy.types.KARF_OT_install_engine
    values, drawn = {"build": "auto", "photos": False, "folder": "", "wheels": "", "starter": ""} | values, []
    shown = SimpleNamespace(layout=Layout(bpy, drawn), bl_rna=bpy.ops.karf.install_engine.get_rna_type(), **values)
    shown._plan = MethodType(kind._plan, shown)
    assert kind.check(shown, bpy.context)
    kind.draw(shown, bpy.context)
    return " ".join(drawn)


def test_engine_python_is_found_in_order_of_precedence(bpy, addon, preferences, tmp_path, monkeypatch):
    find = addon.preferences.engine_python
    preferred, variable = tmp_path / "preferred", tmp_path / "variable"
    installed = addon.home.python_of(tmp_path / "engine" / "env")
    beside = addon.home.python_of(tmp_path / ".venv" / "engine")
    monkeypatch.setattr(addon.engine_api, "ENGINE_FOLDER", tmp_path / "karf_engine")
    monkeypatch.setattr(addon.home, "python_in", lambda folder: installed if installed.exists() else None)
    monkeypatch.setenv("KARF_ENGINE_PYTHON", str(variable))
    preferences.engine_python = str(preferred)
    ways = {
        preferred: lambda: setattr(preferences, "engine_python", ""),
        variable: lambda: monkeypatch.delenv("KARF_ENGINE_PYTHON"),
        installed: installed.unlink,
        beside: beside.unlink,
    }
    for path in ways:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()
    for path, forget in ways.items():
        assert find() == path
        forget()
    with pytest.raises(addon.engine_api.MissingDependency, match="no engine yet"):
        find()
    drawn = drawn_preferences(bpy, preferences)
    assert "There is no engine yet. Press Install Engine, or set Engine Python below" in drawn
    assert "in the KaRF preferences" not in drawn and not bpy.ops.karf.examine_engine.poll()
    preferences.engine_python = str(tmp_path / "gone")
    with pytest.raises(addon.engine_api.MissingDependency, match="gone"):
        find()


@pytest.mark.filterwarnings("ignore:.*blend relative")
@pytest.mark.parametrize("path", ["//python", "python", "./python", "tools/python"])
def test_relative_python_path_is_rejected(bpy, addon, preferences, tmp_path, monkeypatch, path):
    """A stranger's .blend file may come with any program beside it."""
    (tmp_path / "python").write_text("")
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "shot.blend"))
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("KARF_ENGINE_PYTHON", path)
    for preferred in ("", path):
        preferences.engine_python = preferred
        with pytest.raises(addon.engine_api.MissingDependency, match="absolute path"):
            addon.preferences.engine_python()
    with pytest.raises(RuntimeError, match="absolute path"):
        bpy.ops.karf.examine_engine()


@pytest.mark.filterwarnings("ignore:.*blend relative")
def test_engine_folder_becomes_absolute(bpy, addon, preferences, tmp_path):
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "shot.blend"))
    preferences.engine_folder = "//engine"
    assert Path(preferences.engine_folder) == tmp_path / "engine" == addon.preferences.engine_folder()


@pytest.mark.parametrize(
    ("found", "expected", "button"),
    [
        (("ready", "", "Installed: torch.", True), "Engine ready. Installed: torch.", "Repair"),
        (("outdated", "", "Update gets them.", True), "Update gets them.", "Update"),
        (("broken", "No engine.", "Its Python is gone.", True), "Its Python is gone.", "Repair"),
        (("unfinished", "No engine.", "It is not finished.", True), "It is not finished.", "Go On"),
        (("ready", "", "", False), "another", "Repair"),
        (("none", "", "", False), "Test Engine", "Install Engine"),
    ],
)
def test_sentence_and_button_show_the_engine_state(bpy, addon, preferences, engine, found, expected, button):
    state, _, _, is_managed = found
    sentence = addon.preferences.sentence(engine(*found))
    assert sentence == expected if is_managed else expected in sentence
    drawn = drawn_preferences(bpy, preferences)
    assert sentence in drawn and f"{button} karf.install_engine" in drawn
    assert ("karf.remove_engine" in drawn) == (state != "none")


@pytest.mark.parametrize("is_managed", [True, False])
def test_network_access_is_asked_for_only_to_install(bpy, preferences, engine, is_managed):
    engine("none", "There is no engine yet." if is_managed else "", is_managed=is_managed)
    is_asked = "Allow Online Access" in drawn_preferences(bpy, preferences)
    assert is_asked == (is_managed and not bpy.app.online_access)


@pytest.mark.parametrize("kind, is_shown", [("DataError", True), ("Cancelled", False)])
def test_failed_but_not_cancelled_installation_shows_an_error(bpy, addon, preferences, monkeypatch, kind, is_shown):
    error = getattr(addon.engine_api, kind)("The disk is full.", "Free some space.")
    monkeypatch.setattr(addon.session.get(addon.installing._State), "error", error)
    assert ("The disk is full. Free some space." in drawn_preferences(bpy, preferences)) == is_shown


def test_dialog_shows_the_plan_and_its_commands(bpy, preferences, launched, tmp_path):
    drawn = dialog(bpy, folder=str(tmp_path / "engine"))
    assert f"To {tmp_path / 'engine'}." in drawn and "About 351 MB." in drawn
    assert drawn.count("karf.copy_command") == 3 and not launched


def test_dialog_shows_why_installing_is_impossible(bpy, preferences, tmp_path):
    (tmp_path / "empty").mkdir()
    drawn = dialog(bpy, folder=str(tmp_path / "engine"), wheels=str(tmp_path / "empty"), build="cpu")
    assert str(tmp_path / "empty") in drawn and "karf.copy_command" not in drawn
    assert not (tmp_path / "engine").exists()


def test_install_uses_the_choices_and_keeps_the_folder(bpy, addon, preferences, launched, tmp_path):
    folder, wheels = tmp_path / "my engine", tmp_path / "wheels"
    assert bpy.ops.karf.install_engine(build="cpu", photos=True, folder=str(folder), wheels=str(wheels)) == {"FINISHED"}
    (planned,) = launched
    assert planned.choices == type(planned.choices)(folder, "cpu", ("photos",), wheels, "")
    assert addon.preferences.engine_folder() == folder


def test_running_installation_shows_progress_and_cancel(bpy, addon, preferences, monkeypatch):
    cancelled = []
    progress = SimpleNamespace(fraction=0.4, title="Installing torch", sentence="Installing torch, 151 of 351 MB")
    at_work = SimpleNamespace(progress=progress, can_be_cancelled=True, end=lambda: cancelled.append(True))
    assert not bpy.ops.karf.cancel_installation.poll()
    monkeypatch.setattr(addon.session.get(addon.installing._State), "work", at_work)
    drawn = drawn_preferences(bpy, preferences)
    assert "Installing torch, 151 of 351 MB" in drawn and "karf.cancel_installation" in drawn
    for name in ("install_engine", "remove_engine", "examine_engine"):
        assert not getattr(bpy.ops.karf, name).poll()
    assert bpy.ops.karf.cancel_installation() == {"FINISHED"} and cancelled


@pytest.mark.parametrize("is_locked", [False, True])
def test_remove_does_not_block_and_shows_errors(bpy, addon, preferences, tmp_path, monkeypatch, is_locked):
    def fail(*_, **__):
        raise PermissionError(13, "Permission denied", "torch.dll")

    installing, folder = addon.installing, tmp_path / "engine"
    addon.home.claim(folder, {"build": "cpu", "extras": ["photos"], "platform": "any", "python": "3.11"})
    (folder / "env" / "lib").mkdir(parents=True)
    preferences.engine_folder = str(folder)
    if is_locked:
        monkeypatch.setattr(addon.home.chores, "command", lambda *arguments: ("true",))
        monkeypatch.setattr(addon.home.chores, "remove", fail)
    installing._begin(installing.Removal, folder)
    assert "Removing the engine ..." in drawn_preferences(bpy, preferences)
    assert not bpy.ops.karf.install_engine.poll() and not bpy.ops.karf.cancel_installation.poll()
    run_to_end(installing._tick)
    assert not installing.is_running() and folder.exists() == is_locked
    assert (installing.last_error() is not None) == is_locked
    assert ("torch.dll: Permission denied" in drawn_preferences(bpy, preferences)) == is_locked
    addon.session.get(installing._State).error = None


def test_folder_not_made_by_karf_is_not_removed(bpy, preferences, tmp_path):
    (tmp_path / "film.blend").touch()
    preferences.engine_folder = str(tmp_path)
    with pytest.raises(RuntimeError, match="was not made by KaRF"):
        bpy.ops.karf.remove_engine()
    assert (tmp_path / "film.blend").exists()
