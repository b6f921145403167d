"""The extension works whatever order its modules are found in, and disabling it leaves nothing behind."""

import random
import re
import shutil

import pytest

from tools.window.remains import remains

from .conftest import MODULE
from .saved_files import DATA, run_trial
from .test_saved_files import SAVED, assert_trial

TRIALS = ("frame 11", "added color dragged", "target dragged", "other look chosen", "split")


@pytest.fixture
def operators(bpy):
    """Functions that disable and enable the extension as Blender's preferences do; it ends enabled."""
    preferences = bpy.ops.preferences
    yield lambda: preferences.addon_disable(module=MODULE), lambda: preferences.addon_enable(module=MODULE)
    if MODULE not in bpy.context.preferences.addons:
        preferences.addon_enable(module=MODULE)


def held_items(bpy, addon):
    """Everything that Blender or the session holds of the extension, in words."""
    from bl_ui.space_toolsystem_toolbar import IMAGE_PT_tools_active

    session = addon.session._session
    keymaps = bpy.context.window_manager.keyconfigs.addon
    keys = [item for keymap in keymaps.keymaps for item in keymap.keymap_items] if keymaps else []
    return [
        *remains(MODULE),
        *(f"state {kind.__name__}" for kind in session.states),
        *(f"timer {timer}" for timer in session.timers),
        *(f"tool {name}" for name in re.findall(r"karf\.\w+", str(IMAGE_PT_tools_active._tools))),
        *(f"key {item.type} of {item.idname}" for item in keys if item.idname.startswith("karf")),
        *(["translations"] if bpy.app.translations.pgettext_iface("Merge", "KaRF") != "Merge" else []),
    ]


def lasting_items(bpy, addon):
    """Return the items that it always holds: no timers or states."""
    return sorted(each for each in held_items(bpy, addon) if not each.startswith(("timer", "state")))


def test_disabling_leaves_nothing_and_enabling_restores_all(bpy, addon, operators, tmp_path):
    disable, enable = operators
    before = lasting_items(bpy, addon)
    assert {each.partition(" ")[0] for each in before} >= {"handler", "class", "property", "drawing", "tool", "key"}
    blend = shutil.copytree(DATA / SAVED[-1], tmp_path / "saved") / "scene.blend"
    run_trial(bpy, blend, "frame 11", tmp_path)  # a session with something in memory
    for _ in range(2):
        assert disable() == {"FINISHED"}
        assert held_items(bpy, addon) == []
        assert enable() == {"FINISHED"}
        assert lasting_items(bpy, addon) == before


@pytest.mark.parametrize("seed", range(2))
def test_modules_register_in_any_order(bpy, addon, operators, monkeypatch, tmp_path, seed):
    disable, enable = operators
    before, in_order = lasting_items(bpy, addon), addon.session._submodules

    def shuffled(package):
        found = list(in_order(package))
        random.Random(seed).shuffle(found)
        return found

    disable()
    monkeypatch.setattr(addon.session, "_submodules", shuffled)
    assert enable() == {"FINISHED"}
    assert lasting_items(bpy, addon) == before
    saved = shutil.copytree(DATA / SAVED[-1], tmp_path / "saved")
    for trial in TRIALS:
        assert_trial(bpy, saved, trial, tmp_path)
    disable()
    assert held_items(bpy, addon) == []
