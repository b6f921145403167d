"""Swatch gestures: the colors they set, undo and redo, and rejected input."""

import random
from functools import partial

import numpy as np
import pytest

from ..rich_project import LEARNED as RICH
from ..rich_project import enrich
from ..saved_files import everything_stored, picture
from .scenes import BLUE, GREEN, LID, POT, RED, YELLOW, color

POT1, POT2, LID1, LID2 = ("pot", 1), ("pot", 2), ("lid", 1), ("lid", 2)
LEARNED = dict(zip((LID1, LID2, POT1, POT2), LID + POT, strict=True))
TEAL, PINK, BRIGHT = (0.1, 0.2, 0.3), (0.7, 0.3, 0.4), (1.5, 0.25, 0.0)


class Artist:
    """An artist at the open scene: calls any step by its name, operators, and sets the panel's fields."""

    def __init__(self, bpy, addon, folder):
        self.bpy, self.addon, self.folder, self.ops = bpy, addon, folder, bpy.ops.karf

    def __getattr__(self, name):
        return partial(getattr(self.addon.steps, name), self.scene)

    @property
    def scene(self):
        return self.bpy.context.scene

    def item(self, name):
        return self.scene.karf.objects[name]

    def swatch(self, name, index):
        return self.item(name).swatches[index]

    def edit(self, name, *arguments):
        return getattr(self.addon.edits, name)(self.scene, *arguments)

    def drag(self, place, *colors, **numbers):
        """Drag a swatch's color over colors, and its numbers over values."""
        for name, values in {"color": colors, **numbers}.items():
            for value in values:
                setattr(self.swatch(*place), name, value)

    def toggle(self, owner, name, values=(False, True)):
        owner = self.item(owner) if owner else self.scene.karf
        setattr(owner, name, values[0] if getattr(owner, name) == values[1] else values[1])

    def lock(self, *places):
        for place in places:
            self.swatch(*place).locked = True

    def unlock(self):
        for item in self.scene.karf.objects:
            for swatch in item.swatches[1:]:
                swatch.locked = False

    def unlink(self, place):
        self.unlink_swatch(*place)
        assert not self.swatch(*place).link

    def fill(self, name, **values):
        """Fill fields of an object."""
        for field, value in values.items():
            setattr(self.item(name), field, value)

    def press(self, *pair):
        """Choose the pot's source, target and rule, and press Becomes."""
        if pair:
            self.fill("pot", **dict(zip(("source", "target", "rule"), pair, strict=False)))
        self.ops.becomes(object_name="pot")

    def pick_in_picture(self, name, column):
        self.item(name).source = picture(self.bpy)[8, column] / 255

    def preset(self):
        self.item("pot").palette = self.item("lid").palette

    def paste(self, name, text=""):
        self.edit("paste", name, None, text or self.edit("copied", "pot", None))

    def script_edit(self):
        palettes = {each.name: each.colors.copy() for each in self.addon.colors.palettes(self.scene)}
        palettes["pot"][1] = TEAL
        self.apply_edit(self.addon.steps.Edit(palettes))

    def keep_file(self, name, color):
        """Save an edit with this color, and take it back."""
        self.set_swatch(*POT2, color)
        assert self.ops.save_edit(filepath=str(self.folder / name)) == {"FINISHED"}
        self.edit("reset", "pot")

    def load_file(self, name):
        self.ops.load_edit(filepath=str(self.folder / name))

    def locked_blue(self):
        self.save_edit(self.folder / "learned.json")
        self.set_swatch(*POT1, BLUE)
        self.set_swatch(*POT2, PINK)
        self.lock(POT1)


@pytest.fixture
def artist(bpy, addon, learned, tmp_path):
    return Artist(bpy, addon, tmp_path)


def do(name, /, *arguments, **options):
    """A gesture that calls a step or a method of the artist."""
    return lambda artist: getattr(artist, name)(*arguments, **options)


def operator(idname, **options):
    return lambda artist: getattr(artist.ops, idname)(**options)


def set_to(place, color):
    return do("set_swatch", *place, color)


def then(*gestures):
    return lambda artist: [gesture(artist) for gesture in gestures]


SWAP = {"object_name": "pot", "index": 1, "other_name": "lid", "other_index": 2}
BLUE_LID, LOCKED = set_to(LID2, BLUE), do("locked_blue")
LINK_THREE = then(do("link_swatches", POT1, LID2), do("link_swatches", LID1, POT1))
DRAG_LINKED, LINK_LOCKED = then(LINK_THREE, do("drag", POT1, GREEN)), then(LOCKED, do("link_swatches", LID1, POT1))
MERGE, LINK = do("merge_swatch", *POT2), do("link_swatches", POT1, LID1)
SPLIT = then(MERGE, set_to(POT1, PINK), do("split_swatch", *POT1))
TURN_BLUE, LOCK = do("becomes", "pot", RED, BLUE), do("lock", POT2)
RED_TO_PINK, YELLOW_TO_BLUE = do("press", RED, PINK), do("press", YELLOW, BLUE)
PICK = do("fill", "pot", source=RED, target=BLUE, rule="fewest")
# name: preparation, gesture, resulting colors (None: any); all other colors are as learned
GESTURES = {
    "script": (then(), set_to(POT1, BLUE), {POT1: BLUE}),
    "script's edit": (then(), do("script_edit"), {POT1: TEAL}),
    "link": (BLUE_LID, operator("link_swatches", **SWAP), {POT1: BLUE, LID2: BLUE}),
    "linked": (LINK_THREE, do("drag", POT1, GREEN), {POT1: GREEN, LID1: GREEN, LID2: GREEN}),
    "reset linked": (DRAG_LINKED, operator("reset_swatch", object_name="pot", index=1), {}),
    "unlinked": (then(LINK, do("unlink", POT1), do("unlink", LID1)), set_to(POT1, GREEN), {POT1: GREEN}),
    "merge": (then(), operator("merge_swatch", object_name="pot", index=2), {}),
    "merged": (MERGE, set_to(POT1, PINK), {POT1: PINK, POT2: (0.8, 1, 0.8)}),
    "split": (SPLIT, set_to(POT1, BLUE), {POT1: BLUE, POT2: (0.8, 1, 0.8)}),
    "swap": (then(), operator("swap_swatches", **SWAP), {POT1: LID[1], LID2: RED}),
    "reset": (BLUE_LID, operator("reset_swatch", object_name="lid"), {}),
    "paste": (set_to(POT2, BRIGHT), do("paste", "lid"), {LID1: RED, LID2: BRIGHT, POT2: BRIGHT}),
    "paste one": (then(), do("edit", "paste", *LID1, "#993366"), {LID1: (0.6, 0.2, 0.4)}),
    "preset": (BLUE_LID, do("preset"), {LID2: BLUE, POT1: LID[0], POT2: BLUE}),
    "edit file": (do("keep_file", "a.json", BRIGHT), do("load_file", "a.json"), {POT2: BRIGHT}),
    "GIMP palette": (do("keep_file", "a.gpl", TEAL), do("load_file", "a.gpl"), {POT2: TEAL}),
    "Adobe palette": (do("keep_file", "a.ase", TEAL), do("load_file", "a.ase"), {POT2: TEAL}),
    "becomes": (LOCK, do("press", RED, BLUE), {POT1: BLUE}),
    "fewest": (LOCK, do("press", RED, BLUE, "fewest"), {POT1: BLUE}),
    "edited becomes": (TURN_BLUE, do("press", BLUE, GREEN), {POT1: GREEN, POT2: None}),
    "script's becomes": (TURN_BLUE, do("becomes", "pot", BLUE, GREEN, from_edited=True), {POT1: GREEN, POT2: None}),
    "changed since picked": (then(PICK, set_to(POT2, TEAL)), do("press"), {POT1: None, POT2: TEAL}),
    "beside bright paint": (set_to(POT2, (1.3, 1.2, 0.7)), do("press", RED, BLUE), {POT1: BLUE, POT2: None}),
    "paint after paint": (RED_TO_PINK, YELLOW_TO_BLUE, {POT1: PINK, POT2: BLUE}),
    "recolor held paint": (then(RED_TO_PINK, YELLOW_TO_BLUE), do("press", PINK, GREEN), {POT1: GREEN, POT2: BLUE}),
    "reset locked": (LOCKED, operator("reset_swatch", object_name="pot"), {POT1: BLUE}),
    "paste onto locked": (LOCKED, do("paste", "pot", "#00ff00 #00ff00"), {POT1: BLUE, POT2: (0, 1, 0)}),
    "edit file onto locked": (LOCKED, do("load_file", "learned.json"), {POT1: BLUE}),
    "linked to locked": (LINK_LOCKED, set_to(LID1, GREEN), {POT1: BLUE, POT2: PINK, LID1: GREEN}),
}
BYTE = 0.5 / 255 + 1e-6
# 8-bit palettes, and a solver that stops early
TOLERANCES = dict.fromkeys(("paste", "preset", "GIMP palette"), BYTE) | {"becomes": 0.01, "fewest": 1e-3}
TOLERANCES |= {"edited becomes": 0.02, "script's becomes": 0.02, "beside bright paint": 0.05}
TOLERANCES |= {"paint after paint": 0.06, "recolor held paint": 0.06}


def state(artist):
    return everything_stored(artist.scene.karf), picture(artist.bpy)


def assert_same(found, wanted):
    assert found[0] == wanted[0]
    assert np.abs(found[1].astype(int) - wanted[1]).max() <= 1  # rounded sums of changes


@pytest.mark.parametrize("gesture", GESTURES)
def test_gesture_sets_these_colors_and_undo_reverts_it(bpy, artist, gesture):
    prepare, act, wanted = GESTURES[gesture]
    prepare(artist)
    bpy.ops.ed.undo_push(message="before")
    before = state(artist)
    act(artist)
    after = state(artist)
    tolerance = TOLERANCES.get(gesture, 1e-6)
    for place, learned in LEARNED.items():
        expected = wanted.get(place, learned)
        if expected is not None:
            np.testing.assert_allclose(color(artist.scene, *place), expected, atol=tolerance)
    assert after[0] != before[0]
    bpy.ops.ed.undo_push(message="gesture")
    bpy.ops.ed.undo()
    assert_same(state(artist), before)
    bpy.ops.ed.redo()
    assert_same(state(artist), after)


# gestures that change more than colors; swatch numbers as in the rich project
MORE = (
    do("drag", ("pot", 3), GREEN),
    do("drag", POT1, RED, (0.4, 0.5, 0.2), (1.1, 0.5, 0.2)),
    do("drag", ("lid", 3), BRIGHT),
    do("drag", ("pot", 5), BLUE),
    do("lock", ("pot", 4)),
    operator("unlink_swatch", object_name="lid", index=2),
    operator("merge_swatch", object_name="lid", index=1),
    operator("split_swatch", object_name="pot", index=1),
    do("drag", POT1, saturation=(0.3, 1.8)),
    do("drag", ("pot", 3), brightness=(-0.5,), gloss=(0.2,)),
    operator("reset_surface", object_name="pot", index=1),
    do("pick_in_picture", "pot", 20),
    do("pick_in_picture", "lid", 2),
    do("fill", "pot", target=(0.2, 0.4, 0.6)),
    do("fill", "pot", target=(0.9, 0.4, 0.6)),
    do("fill", "pot", choke=1.5, feather=2.5),
    do("toggle", "pot", "live"),
    do("toggle", "pot", "is_metal"),
    do("toggle", "pot", "scope", ("PAINT", "OBJECT")),
    do("toggle", "", "material"),
    do("toggle", "", "compositing", ("delta", "paper")),
    do("toggle", "", "active_view", ("photo_0", "photo_1")),
    operator("add_color", object_name="pot", picked=RICH["pot"][3]),
    operator("add_color", object_name="lid", picked=RICH["lid"][1]),
    lambda artist: setattr(artist.swatch("pot", 5), "reach", 0.7),
    operator("remove_color", object_name="pot", index=5),
    operator("keep_look"),
    operator("keep_look", name="A"),
    operator("choose_look", name="A"),
    operator("flip_looks"),
)


@pytest.mark.parametrize("has_paints", [False, True], ids=["swatches", "paints"])
def test_shuffled_gestures_undo_and_redo_exactly(bpy, addon, artist, monkeypatch, has_paints):
    if has_paints:
        monkeypatch.setattr(addon.palettes, "object_paints", addon.engine_api.object_paints)
    monkeypatch.setattr(bpy.context.preferences.edit, "undo_steps", 200)  # more than there are gestures
    enrich(bpy, artist.folder / "project")
    for name in ("learned.json", "a.json", "a.gpl", "a.ase"):
        artist.save_edit(artist.folder / name)
    gestures = [each for row in GESTURES.values() for each in row[:2]] + [*MORE, *MORE] + 8 * [Artist.unlock]
    random.Random(1).shuffle(gestures)
    bpy.ops.ed.undo_push(message="begin")
    states, rejected = [state(artist)], 0
    for gesture in gestures:
        try:
            gesture(artist)
        except (RuntimeError, addon.steps.KarfError, IndexError) as error:
            assert "Traceback" not in str(error), error
            rejected += 1
        bpy.ops.ed.undo_push(message="gesture")
        states.append(state(artist))
    assert rejected < len(gestures) / 4
    for wanted in reversed(states[:-1]):
        bpy.ops.ed.undo()
        assert_same(state(artist), wanted)
    for wanted in states[1:]:
        bpy.ops.ed.redo()
        assert_same(state(artist), wanted)


def test_copied_color_is_hex_and_palette_files_keep_compositing(artist):
    assert artist.edit("copied", *POT1) == "#cc331a"
    for name in ("a.gpl", "a.ase"):
        artist.keep_file(name, TEAL)
        artist.scene.karf.compositing = "paper"
        artist.apply_edit(artist.folder / name)
        assert artist.scene.karf.compositing == "paper"


def test_becomes_moves_merged_swatches_as_one(artist):
    artist.merge_swatch(*POT2, 1)
    artist.becomes("pot", RED, (0.5, 0.4, 0.3))
    moved = color(artist.scene, *POT1) - RED
    np.testing.assert_allclose(color(artist.scene, *POT2) - YELLOW, moved, atol=1e-6)
    assert np.abs(moved).max() > 0.1


REJECTED = (
    ("Objects: lid, pot", set_to(("kettle", 1), "#ffffff")),
    ("no swatch 0", set_to(("pot", 0), "#ffffff")),
    ("'photo_9'", lambda artist: artist.show_view("photo_9").wait()),
    ("no color", do("paste", "lid", "no color at all")),
    ("black", do("add_color", "pot", (0, 0, 0))),
    ("merged into 1", set_to(POT2, BLUE)),
    ("cannot be linked with that swatch", do("link_swatches", POT1, POT2)),
    ("cannot be merged into another", do("merge_swatch", *POT1)),
    ("cannot be merged into 3", do("merge_swatch", *LID1, 3)),
    ("is an added color", do("merge_swatch", "pot", 3)),
    ("is a learned color", do("remove_color", *POT1)),
    ("added to pot", lambda artist: artist.save_edit(artist.folder / "pots.gpl")),
    ("gloss", do("set_surface", *POT1, gloss=-1.0)),
    ("pot shows no color like #00ff00", do("becomes", "pot", (0, 1, 0), BLUE)),
)
LOCKED_TOOLS = (
    set_to(POT1, GREEN),
    do("set_surface", *POT1, gloss=0.0),
    do("edit", "reset", *POT1),
    do("edit", "swap", LID1, POT1),
    do("edit", "paste", *POT1, "#00ff00"),
    do("link_swatches", POT1, LID2),
    do("merge_swatch", *POT1, 2),
    do("remove_color", "pot", 3),
    lambda artist: artist.apply_edit(artist.folder / "without.json"),  # has no added color
)


def test_rejected_gestures_say_why_and_change_nothing(addon, artist):
    assert artist.merge_swatch(*POT2) == 1 and artist.add_color("pot", YELLOW, BLUE) == 3
    before = state(artist)
    for reason, tool in REJECTED:
        with pytest.raises(addon.steps.KarfError, match=reason):
            tool(artist)
    assert_same(state(artist), before)


def test_no_tool_changes_a_locked_swatch(addon, artist):
    artist.save_edit(artist.folder / "without.json")
    artist.add_color("pot", YELLOW, BLUE)
    artist.set_swatch(*POT1, GREEN)
    artist.lock(POT1, ("pot", 3))
    before = state(artist)
    for tool in LOCKED_TOOLS:
        with pytest.raises(addon.engine_api.BadRequest, match="locked"):
            tool(artist)
    assert_same(state(artist), before)


def test_the_field_of_a_locked_swatch_changes_nothing_and_says_why(bpy, addon, artist):
    artist.set_swatch(*POT1, GREEN)
    artist.lock(POT1)
    before = state(artist)
    artist.drag(POT1, BLUE, RED)
    assert_same(state(artist), before)
    assert "Swatch 1 of 'pot' is locked" in addon.progress.state().warnings
