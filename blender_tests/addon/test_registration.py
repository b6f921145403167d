"""The extension is enabled in any order of its modules, does what it does in every other, and leaves nothing behind."""

import json
import random
import re
import shutil

import numpy as np
import pytest

from tools.window.remains import remains

from .conftest import MODULE
from .saved_files import DATA, tried
from .test_saved_files import SAVED, compare

TRIALS = ("frame 11", "added color dragged", "target dragged", "other look chosen", "split")


@pytest.fixture
def operators(bpy):
    """Disables and enables the extension as Blender's preferences do; it is enabled at the end."""
    preferences = bpy.ops.preferences
    yield lambda: preferences.addon_disable(module=MODULE), lambda: preferences.addon_enable(module=MODULE)
    if MODULE not in bpy.context.preferences.addons:
        preferences.addon_enable(module=MODULE)


def held(bpy, addon):
    """List what Blender, or the session, holds of the extension, in words."""
    from bl_ui.space_toolsystem_toolbar import IMAGE_PT_tools_active

    known = addon.session._session
    keymaps = bpy.context.window_manager.keyconfigs.addon
    keys = [item for keymap in keymaps.keymaps for item in keymap.keymap_items] if keymaps else []
    return [
        *remains(MODULE),
        *(f"state {kind.__name__}" for kind in known.states),
        *(f"timer {timer}" for timer in known.timers),
        *(f"tool {name}" for name in re.findall(r"karf\.\w+", str(IMAGE_PT_tools_active._tools))),
        *(f"key {item.type} of {item.idname}" for item in keys if item.idname.startswith("karf")),
        *(["translations"] if bpy.app.translations.pgettext_iface("Merge", "KaRF") != "Merge" else []),
    ]


def lasting(bpy, addon):
    """Leave out what comes and goes."""
    return sorted(each for each in held(bpy, addon) if not each.startswith(("timer", "state")))


def test_nothing_stays_when_it_is_disabled_and_all_is_back_when_it_is_enabled(bpy, addon, operators, tmp_path):
    disable, enable = operators
    before = lasting(bpy, addon)
    assert {each.partition(" ")[0] for each in before} >= {"handler", "class", "property", "drawing", "tool", "key"}
    blend = shutil.copytree(DATA / SAVED[-1], tmp_path / "saved") / "scene.blend"
    tried(bpy, blend, "frame 11", tmp_path)  # a session with something in memory
    for _ in range(2):
        assert disable() == {"FINISHED"}
        assert held(bpy, addon) == []
        assert enable() == {"FINISHED"}
        assert lasting(bpy, addon) == before


@pytest.mark.parametrize("seed", range(2))
def test_modules_are_found_in_any_order(bpy, addon, operators, monkeypatch, tmp_path, seed):
    disable, enable = operators
    before, in_order = lasting(bpy, addon), addon.session._submodules

    def shuffled(package):
        found = list(in_order(package))
        random.Random(seed).shuffle(found)
        return found

    disable()
    monkeypatch.setattr(addon.session, "_submodules", shuffled)
    assert enable() == {"FINISHED"}
    assert lasting(bpy, addon) == before
    saved = shutil.copytree(DATA / SAVED[-1], tmp_path / "saved")
    expected, pictures = json.loads((saved / "expected.json").read_text()), np.load(saved / "pictures.npz")
    for trial in TRIALS:
        told, picture = tried(bpy, saved / "scene.blend", trial, tmp_path)
        compare(told, expected["trials"][trial], trial)
        assert np.abs(picture.astype(int) - pictures[trial.replace(" ", "_")]).max() <= 1
    disable()
    assert held(bpy, addon) == []
