"""The preferences choose the engine's Python and say how it stands; buttons install, cancel, repair and remove it."""

from pathlib import Path
from types import MethodType, SimpleNamespace

import pytest

from ..layout import Layout, drawn_preferences
from ..timers import run_to_end


@pytest.fixture
def managed(addon, chosen, tmp_path):
    """A folder that is KaRF's, with an environment."""
    folder = tmp_path / "engine"
    addon.home.claim(folder, {"build": "cpu", "extras": ["photos"], "platform": "any", "python": "3.11"})
    (folder / "env" / "lib").mkdir(parents=True)
    chosen.engine_folder = str(folder)
    return folder


@pytest.fixture
def engine(addon, monkeypatch, tmp_path):
    """A function that makes an engine as it may be found, which the preferences then know."""

    def made(state, problem="", sentence="", is_managed=True):
        python = addon.home.python_of(tmp_path / "env") if is_managed else tmp_path / "another"
        found = addon.state.Engine(python, problem, tmp_path, addon.home.Status(state, sentence))
        monkeypatch.setattr(addon.state, "known", lambda: found)
        return found

    return made


class Planned:
    """A plan as far as the buttons need it."""

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
    """The text of the dialog of *Install Engine* with these values."""
    kind = bpy.types.KARF_OT_install_engine
    values = {"build": "auto", "photos": False, "folder": "", "wheels": "", "starter": ""} | values
    drawn = []
    shown = SimpleNamespace(layout=Layout(bpy, drawn), bl_rna=bpy.ops.karf.install_engine.get_rna_type(), **values)
    shown._plan = MethodType(kind._plan, shown)
    assert kind.check(shown, bpy.context)
    kind.draw(shown, bpy.context)
    return " ".join(drawn)


# --- the engine's Python -------------------------------------------------------------------------------------------
def test_the_preference_comes_before_the_variable_the_installed_engine_and_the_checkout(
    bpy, addon, chosen, tmp_path, monkeypatch
):
    find = addon.preferences.engine_python
    preferred, variable = tmp_path / "preferred", tmp_path / "variable"
    installed = addon.home.python_of(tmp_path / "engine" / "env")
    beside = addon.home.python_of(tmp_path / ".venv" / "engine")
    monkeypatch.setattr(addon.engine_api, "ENGINE_FOLDER", tmp_path / "karf_engine")
    monkeypatch.setattr(addon.home, "python_in", lambda folder: installed if installed.exists() else None)
    monkeypatch.setenv("KARF_ENGINE_PYTHON", str(variable))
    chosen.engine_python = str(preferred)
    ways = {
        preferred: lambda: setattr(chosen, "engine_python", ""),
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
    drawn = drawn_preferences(bpy, chosen)
    assert "There is no engine yet. Press Install Engine, or set Engine Python below" in drawn
    assert "in the KaRF preferences" not in drawn and not bpy.ops.karf.examine_engine.poll()
    chosen.engine_python = str(tmp_path / "gone")
    with pytest.raises(addon.engine_api.MissingDependency, match="gone"):
        find()


@pytest.mark.filterwarnings("ignore:.*blend relative")
@pytest.mark.parametrize("path", ["//python", "python", "./python", "tools/python"])
def test_a_python_relative_to_the_open_file_is_refused(bpy, addon, chosen, tmp_path, monkeypatch, path):
    """A stranger's .blend may have any program beside it."""
    (tmp_path / "python").write_text("")
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "shot.blend"))
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("KARF_ENGINE_PYTHON", path)
    for preferred in ("", path):
        chosen.engine_python = preferred
        with pytest.raises(addon.engine_api.MissingDependency, match="absolute path"):
            addon.preferences.engine_python()
    with pytest.raises(RuntimeError, match="absolute path"):
        bpy.ops.karf.examine_engine()


@pytest.mark.filterwarnings("ignore:.*blend relative")
def test_an_engine_folder_relative_to_the_open_file_is_made_absolute(bpy, addon, chosen, tmp_path):
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "shot.blend"))
    chosen.engine_folder = "//engine"
    assert Path(chosen.engine_folder) == tmp_path / "engine" == addon.preferences.engine_folder()


# --- the sentence and the button -----------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("state", "problem", "sentence", "is_managed", "said", "button"),
    [
        ("ready", "", "Installed: torch.", True, "Engine ready. Installed: torch.", "Repair"),
        ("outdated", "", "Update gets them.", True, "Update gets them.", "Update"),
        ("broken", "No engine.", "Its Python is gone.", True, "Its Python is gone.", "Repair"),
        ("unfinished", "No engine.", "It is not finished.", True, "It is not finished.", "Go On"),
        ("ready", "", "", False, "another", "Repair"),
        ("none", "", "", False, "Test Engine", "Install Engine"),
    ],
)
def test_sentence_and_button_follow_the_engines_state(
    bpy, addon, chosen, engine, state, problem, sentence, is_managed, said, button
):
    told = addon.preferences.sentence(engine(state, problem, sentence, is_managed))
    assert told == said if is_managed else said in told
    drawn = drawn_preferences(bpy, chosen)
    assert told in drawn and f"{button} karf.install_engine" in drawn
    assert ("karf.remove_engine" in drawn) == (state != "none")


@pytest.mark.parametrize("is_managed", [True, False])
def test_network_access_is_asked_for_only_to_install(bpy, chosen, engine, is_managed):
    engine("none", "There is no engine yet." if is_managed else "", is_managed=is_managed)
    is_asked = "Allow Online Access" in drawn_preferences(bpy, chosen)
    assert is_asked == (is_managed and not bpy.app.online_access)


@pytest.mark.parametrize("kind, is_told", [("DataError", True), ("Cancelled", False)])
def test_failed_installation_is_reported_and_a_cancelled_one_is_not(bpy, addon, chosen, monkeypatch, kind, is_told):
    error = getattr(addon.engine_api, kind)("The disk is full.", "Free some space.")
    monkeypatch.setattr(addon.session.get(addon.installing._State), "error", error)
    assert ("The disk is full. Free some space." in drawn_preferences(bpy, chosen)) == is_told


# --- installing ----------------------------------------------------------------------------------------------------
def test_dialog_shows_the_plan_and_its_commands(bpy, chosen, launched, tmp_path):
    drawn = dialog(bpy, folder=str(tmp_path / "engine"))
    assert f"To {tmp_path / 'engine'}." in drawn and "About 351 MB." in drawn
    assert drawn.count("karf.copy_command") == 3 and not launched


def test_dialog_shows_why_installing_is_impossible(bpy, chosen, tmp_path):
    (tmp_path / "empty").mkdir()
    drawn = dialog(bpy, folder=str(tmp_path / "engine"), wheels=str(tmp_path / "empty"), build="cpu")
    assert str(tmp_path / "empty") in drawn and "karf.copy_command" not in drawn
    assert not (tmp_path / "engine").exists()


def test_install_uses_the_choices_and_remembers_the_folder(bpy, addon, chosen, launched, tmp_path):
    folder, wheels = tmp_path / "my engine", tmp_path / "wheels"
    assert bpy.ops.karf.install_engine(build="cpu", photos=True, folder=str(folder), wheels=str(wheels)) == {"FINISHED"}
    (planned,) = launched
    assert planned.choices == type(planned.choices)(folder, "cpu", ("photos",), wheels, "")
    assert addon.preferences.engine_folder() == folder


def test_running_installation_shows_progress_and_cancel(bpy, addon, chosen, monkeypatch):
    cancelled = []
    progress = SimpleNamespace(fraction=0.4, title="Installing torch", sentence="Installing torch, 151 of 351 MB")
    at_work = SimpleNamespace(progress=progress, can_be_cancelled=True, end=lambda: cancelled.append(True))
    assert not bpy.ops.karf.cancel_installation.poll()
    monkeypatch.setattr(addon.session.get(addon.installing._State), "work", at_work)
    drawn = drawn_preferences(bpy, chosen)
    assert "Installing torch, 151 of 351 MB" in drawn and "karf.cancel_installation" in drawn
    for name in ("install_engine", "remove_engine", "examine_engine"):
        assert not getattr(bpy.ops.karf, name).poll()
    assert bpy.ops.karf.cancel_installation() == {"FINISHED"} and cancelled


# --- removing ------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("is_refused", [False, True])
def test_remove_does_not_block_and_reports_errors(bpy, addon, chosen, managed, monkeypatch, is_refused):
    def refuse(*_, **__):
        raise PermissionError(13, "Permission denied", "torch.dll")

    installing = addon.installing
    if is_refused:
        monkeypatch.setattr(addon.home.chores, "command", lambda *arguments: ("true",))
        monkeypatch.setattr(addon.home.chores, "remove", refuse)
    installing._begin(installing.Removal, managed)
    assert "Removing the engine ..." in drawn_preferences(bpy, chosen)
    assert not bpy.ops.karf.install_engine.poll() and not bpy.ops.karf.cancel_installation.poll()
    run_to_end(installing._tick)
    assert not installing.is_running() and managed.exists() == is_refused
    assert (installing.last_error() is not None) == is_refused
    assert ("torch.dll: Permission denied" in drawn_preferences(bpy, chosen)) == is_refused
    addon.session.get(installing._State).error = None


def test_a_folder_of_others_is_not_removed(bpy, chosen, tmp_path):
    (tmp_path / "film.blend").touch()
    chosen.engine_folder = str(tmp_path)
    with pytest.raises(RuntimeError, match="was not made by KaRF"):
        bpy.ops.karf.remove_engine()
    assert (tmp_path / "film.blend").exists()
