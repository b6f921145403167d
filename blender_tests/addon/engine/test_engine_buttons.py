"""The preferences say whether there is an engine; their buttons install, cancel, repair and remove it."""

import importlib
from pathlib import Path
from types import MethodType, SimpleNamespace

import pytest

from ..layout import Layout, drawn_preferences
from ..timers import run_to_end


@pytest.fixture
def managed(addon, chosen, tmp_path):
    """A folder that is KaRF's, with an environment of a few files."""
    folder = tmp_path / "engine"
    addon.home.claim(folder, {"build": "cpu", "extras": ["photos"], "platform": "any", "python": "3.11"})
    (folder / "env" / "lib" / "torch").mkdir(parents=True)
    (folder / "env" / "lib" / "torch" / "big.so").write_bytes(bytes(3000))
    chosen.engine_folder = str(folder)
    return folder


@pytest.fixture
def engine(addon, tmp_path):
    """An engine as it may be found, by its state."""

    def made(state, problem="", sentence="", is_managed=True):
        python = addon.home.python_of(tmp_path / "env") if is_managed else tmp_path / "another"
        return addon.state.Engine(python, problem, tmp_path, addon.home.Status(state, sentence))

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
    """Plans in place of installations: those that were launched."""
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


# ---------------------------------------------------------------------------------------------------------- the sentence
def test_without_an_engine_the_preferences_say_what_to_do(bpy, addon, chosen, monkeypatch, tmp_path):
    monkeypatch.delenv("KARF_ENGINE_PYTHON")
    monkeypatch.setattr(addon.engine_api, "ENGINE_FOLDER", tmp_path / "karf_engine")
    chosen.engine_folder = str(tmp_path / "engine")
    drawn = drawn_preferences(bpy, chosen)
    assert "There is no engine yet. Press Install Engine, or set Engine Python below" in drawn
    assert "in the KaRF preferences" not in drawn and "karf.remove_engine" not in drawn
    assert not bpy.ops.karf.examine_engine.poll()


@pytest.mark.parametrize(
    ("state", "button"),
    [
        ("unfinished", "Go On"),
        ("broken", "Repair"),
        ("outdated", "Update"),
        ("ready", "Repair"),
        ("none", "Install Engine"),
    ],
)
def test_the_button_is_called_by_what_it_does(bpy, addon, chosen, engine, monkeypatch, state, button):
    monkeypatch.setattr(addon.state, "known", lambda: engine(state, sentence=f"It is {state}."))
    drawn = drawn_preferences(bpy, chosen)
    assert f"{button} karf.install_engine" in drawn
    assert ("karf.remove_engine" in drawn) == (state != "none")


def test_the_sentence_says_which_python_runs_the_engine(addon, engine):
    say = addon.preferences.sentence
    assert say(engine("ready", sentence="Installed: torch.")) == "Engine ready. Installed: torch."
    assert say(engine("outdated", sentence="Update gets them.")) == "Update gets them."
    assert "another" in say(engine("ready", is_managed=False)) and "Test Engine" in say(
        engine("none", is_managed=False)
    )
    assert say(engine("broken", "No engine.", "Its Python is gone.")) == "Its Python is gone."


def test_offline_the_preferences_say_how_to_allow_the_network(bpy, addon, chosen, engine, monkeypatch):
    monkeypatch.setattr(addon.state, "known", lambda: engine("none", "There is no engine yet."))
    assert bpy.app.online_access or "Allow Online Access" in drawn_preferences(bpy, chosen)


def test_with_an_engine_of_ones_own_nobody_needs_the_network(bpy, addon, chosen, engine, monkeypatch):
    monkeypatch.setattr(addon.state, "known", lambda: engine("none", is_managed=False))
    assert "Allow Online Access" not in drawn_preferences(bpy, chosen)


@pytest.mark.parametrize(
    ("system", "processor", "builds"),
    [
        ("Linux", "x86_64", "cpu cuda rocm"),
        ("Linux", "arm64", "cpu cuda"),
        ("Darwin", "arm64", "cpu mps"),
        ("Haiku", "x86_64", ""),
    ],
)
def test_the_dialog_offers_what_there_is_for_the_system(addon, system, processor, builds):
    computer = importlib.import_module(f"{addon.home.__package__}.computer")
    assert computer.detect_machine(system, processor).builds == tuple(builds.split())


def test_a_failed_installation_is_told_and_a_cancelled_one_is_not(bpy, addon, chosen, monkeypatch):
    api = addon.engine_api
    monkeypatch.setattr(
        addon.session.get(addon.installing._State), "error", api.DataError("The disk is full.", "Free some space.")
    )
    assert "The disk is full. Free some space." in drawn_preferences(bpy, chosen)
    monkeypatch.setattr(
        addon.session.get(addon.installing._State), "error", api.Cancelled("The installation was cancelled.")
    )
    assert "cancelled" not in drawn_preferences(bpy, chosen)


@pytest.mark.filterwarnings("ignore:.*blend relative")
def test_a_path_of_the_open_file_is_made_whole_when_it_is_chosen(bpy, addon, chosen, tmp_path):
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "shot.blend"))
    chosen.engine_folder = "//engine"
    assert Path(chosen.engine_folder) == tmp_path / "engine" == addon.preferences.engine_folder()


# ------------------------------------------------------------------------------------------------------------ installing
def test_the_dialog_says_what_will_happen_and_has_the_commands(bpy, addon, chosen, launched, tmp_path):
    drawn = dialog(bpy, folder=str(tmp_path / "engine"))
    assert f"To {tmp_path / 'engine'}." in drawn and "About 351 MB." in drawn
    assert drawn.count("karf.copy_command") == 3 and not launched


def test_the_dialog_says_why_it_cannot_be_done(bpy, addon, chosen, tmp_path):
    (tmp_path / "empty").mkdir()
    drawn = dialog(bpy, folder=str(tmp_path / "engine"), wheels=str(tmp_path / "empty"), build="cpu")
    assert str(tmp_path / "empty") in drawn and "karf.copy_command" not in drawn
    assert not (tmp_path / "engine").exists()


def test_without_network_and_wheels_the_button_explains(bpy, addon, chosen, tmp_path):
    if bpy.app.online_access:
        pytest.skip("this Blender may use the network")
    assert "Blender may not use the network." in dialog(bpy, folder=str(tmp_path / "engine"))
    with pytest.raises(RuntimeError, match="may not use the network"):
        bpy.ops.karf.install_engine(folder=str(tmp_path / "engine"))


def test_what_was_chosen_is_installed_and_its_folder_remembered(bpy, addon, chosen, launched, tmp_path):
    folder, wheels = tmp_path / "my engine", tmp_path / "wheels"
    assert bpy.ops.karf.install_engine(build="cpu", photos=True, folder=str(folder), wheels=str(wheels)) == {"FINISHED"}
    (planned,) = launched
    assert planned.choices == type(planned.choices)(folder, "cpu", ("photos",), wheels, "")
    assert addon.preferences.engine_folder() == folder


def test_while_it_installs_there_is_progress_and_a_cancel(bpy, addon, chosen, monkeypatch):
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


# -------------------------------------------------------------------------------------------------------------- removing
def test_remove_deletes_the_environment_and_nothing_else(bpy, addon, managed, tmp_path):
    (tmp_path / "films").mkdir()
    (tmp_path / "films" / "pots.blend").touch()
    (managed / "env" / "lib64").symlink_to(tmp_path / "films", target_is_directory=True)
    assert bpy.ops.karf.remove_engine() == {"FINISHED"}
    assert not managed.exists() and (tmp_path / "films" / "pots.blend").exists()


def test_remove_goes_on_beside_the_interface(bpy, addon, chosen, managed):
    installing = addon.installing
    installing._begin(installing.Removal, managed)
    assert "Removing the engine ..." in drawn_preferences(bpy, chosen)
    assert not bpy.ops.karf.install_engine.poll() and not bpy.ops.karf.cancel_installation.poll()
    run_to_end(installing._tick)
    assert not managed.exists() and not installing.is_running() and installing.last_error() is None


def test_what_cannot_be_removed_is_told(bpy, addon, chosen, managed, monkeypatch):
    def refuse(*_, **__):
        raise PermissionError(13, "Permission denied", "torch.dll")

    installing = addon.installing
    monkeypatch.setattr(addon.home.chores, "command", lambda *arguments: ("true",))
    installing._begin(installing.Removal, managed)
    monkeypatch.setattr(addon.home.chores, "remove", refuse)
    run_to_end(installing._tick)
    assert "torch.dll: Permission denied" in drawn_preferences(bpy, chosen)
    addon.session.get(installing._State).error = None


def test_a_folder_of_others_is_not_removed(bpy, addon, chosen, tmp_path):
    (tmp_path / "film.blend").touch()
    chosen.engine_folder = str(tmp_path)
    with pytest.raises(RuntimeError, match="was not made by KaRF"):
        bpy.ops.karf.remove_engine()
    assert (tmp_path / "film.blend").exists()
