"""Gestures at swatches: the colors that they give, undo, and refusals."""

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


class Hand:
    """Does something to the open scene: steps by their names, operators, and what the panel's fields do."""

    def __init__(self, bpy, addon, folder):
        self.bpy, self.addon, self.folder, self.ops = bpy, addon, folder, bpy.ops.karf

    def __getattr__(self, name):
        return partial(getattr(self.addon.steps, name), self.scene)

    @property
    def scene(self):
        return self.bpy.context.scene

    def edit(self, name, *arguments):
        return getattr(self.addon.edits, name)(self.scene, *arguments)

    def item(self, name):
        return self.scene.karf.objects[name]

    def swatch(self, name, index):
        return self.item(name).swatches[index]

    def surface(self, name, index, **numbers):
        for number, value in numbers.items():
            setattr(self.swatch(name, index), number, value)

    def toggle(self, owner, name, values=(False, True)):
        setattr(owner, name, values[0] if getattr(owner, name) == values[1] else values[1])

    def drag(self, place, color):
        self.swatch(*place).color = color

    def lock(self, *places):
        for place in places:
            self.swatch(*place).locked = True

    def unlock(self):
        for item in self.scene.karf.objects:
            for swatch in item.swatches[1:]:
                swatch.locked = False

    def pick(self, source, target, rule="becomes"):
        item = self.item("pot")
        item.source, item.target, item.rule = source, target, rule

    def press(self, *pair):
        """Choose colors of the pot and let the first become the other."""
        if pair:
            self.pick(*pair)
        self.ops.becomes(object_name="pot")

    def preset(self):
        self.item("pot").palette = self.item("lid").palette

    def script_edit(self):
        palettes = {each.name: each.colors.copy() for each in self.addon.colors.palettes(self.scene)}
        palettes["pot"][1] = TEAL
        self.apply_edit(self.addon.steps.Edit(palettes))


@pytest.fixture
def hand(bpy, addon, learned, tmp_path):
    return Hand(bpy, addon, tmp_path)


def nothing(hand):
    pass


def blue_lid(hand):
    hand.set_swatch(*LID2, BLUE)


def link_three(hand):
    hand.link_swatches(POT1, LID2)
    hand.link_swatches(LID1, POT1)


def link_and_unlink(hand):
    hand.link_swatches(POT1, LID1)
    hand.unlink_swatch(*POT1)
    assert not hand.swatch(*LID1).link


def merge(hand):
    assert hand.merge_swatch(*POT2) == 1


def split_again(hand):
    merge(hand)
    hand.set_swatch(*POT1, PINK)
    hand.split_swatch(*POT1)


def locked_blue(hand):
    hand.save_edit(hand.folder / "learned.json")
    hand.set_swatch(*POT1, BLUE)
    hand.set_swatch(*POT2, PINK)
    hand.lock(POT1)


def keep_file(name, color):
    """Save an edit with this color, and take it back."""

    def keep(hand):
        hand.set_swatch(*POT2, color)
        assert hand.ops.save_edit(filepath=str(hand.folder / name)) == {"FINISHED"}
        hand.edit("reset", "pot")

    return keep


def load_file(name):
    return lambda hand: hand.ops.load_edit(filepath=str(hand.folder / name))


SWAP = {"object_name": "pot", "index": 1, "other_name": "lid", "other_index": 2}
# gesture -> what was done before, the gesture, the colors that it gives (None: any); all others are as learned
GESTURES = {
    "script": (nothing, lambda hand: hand.set_swatch(*POT1, BLUE), {POT1: BLUE}),
    "script's edit": (nothing, Hand.script_edit, {POT1: TEAL}),
    "link": (blue_lid, lambda hand: hand.ops.link_swatches(**SWAP), {POT1: BLUE, LID2: BLUE}),
    "linked": (link_three, lambda hand: hand.drag(POT1, GREEN), {POT1: GREEN, LID1: GREEN, LID2: GREEN}),
    "reset of a linked one": (
        lambda hand: (link_three(hand), hand.drag(POT1, GREEN)),
        lambda hand: hand.ops.reset_swatch(object_name="pot", index=1),
        {},
    ),
    "unlinked": (link_and_unlink, lambda hand: hand.set_swatch(*POT1, GREEN), {POT1: GREEN}),
    "merge": (nothing, lambda hand: hand.ops.merge_swatch(object_name="pot", index=2), {}),
    "merged": (merge, lambda hand: hand.set_swatch(*POT1, PINK), {POT1: PINK, POT2: (0.8, 1, 0.8)}),
    "split": (split_again, lambda hand: hand.set_swatch(*POT1, BLUE), {POT1: BLUE, POT2: (0.8, 1, 0.8)}),
    "swap": (nothing, lambda hand: hand.ops.swap_swatches(**SWAP), {POT1: LID[1], LID2: RED}),
    "reset": (blue_lid, lambda hand: hand.ops.reset_swatch(object_name="lid"), {}),
    "paste": (
        lambda hand: hand.set_swatch(*POT2, BRIGHT),
        lambda hand: hand.edit("paste", "lid", None, hand.edit("copied", "pot", None)),
        {LID1: RED, LID2: BRIGHT, POT2: BRIGHT},
    ),
    "preset": (blue_lid, Hand.preset, {LID2: BLUE, POT1: LID[0], POT2: BLUE}),
    "edit file": (keep_file("a.json", BRIGHT), load_file("a.json"), {POT2: BRIGHT}),
    "palette of GIMP": (keep_file("a.gpl", TEAL), load_file("a.gpl"), {POT2: TEAL}),
    "palette of Adobe": (keep_file("a.ase", TEAL), load_file("a.ase"), {POT2: TEAL}),
    "becomes": (lambda hand: hand.lock(POT2), lambda hand: hand.press(RED, BLUE), {POT1: BLUE}),
    "fewest": (lambda hand: hand.lock(POT2), lambda hand: hand.press(RED, BLUE, "fewest"), {POT1: BLUE}),
    "edited becomes": (
        lambda hand: hand.becomes("pot", RED, BLUE),
        lambda hand: hand.press(BLUE, GREEN),
        {POT1: GREEN, POT2: None},
    ),
    "edited becomes by a script": (
        lambda hand: hand.becomes("pot", RED, BLUE),
        lambda hand: hand.becomes("pot", BLUE, GREEN, from_edited=True),
        {POT1: GREEN, POT2: None},
    ),
    "changed since picked": (
        lambda hand: (hand.pick(RED, BLUE, "fewest"), hand.set_swatch(*POT2, TEAL)),
        Hand.press,
        {POT1: None, POT2: TEAL},
    ),
    "becomes beside bright paint": (
        lambda hand: hand.set_swatch(*POT2, (1.3, 1.2, 0.7)),
        lambda hand: hand.press(RED, BLUE),
        {POT1: BLUE, POT2: None},
    ),
    "paint after paint": (
        lambda hand: hand.press(RED, PINK),
        lambda hand: hand.press(YELLOW, BLUE),
        {POT1: PINK, POT2: BLUE},
    ),
    "paint on held paint": (
        lambda hand: (hand.press(RED, PINK), hand.press(YELLOW, BLUE)),
        lambda hand: hand.press(PINK, GREEN),
        {POT1: GREEN, POT2: BLUE},
    ),
    "reset of locked": (locked_blue, lambda hand: hand.ops.reset_swatch(object_name="pot"), {POT1: BLUE}),
    "paste on locked": (
        locked_blue,
        lambda hand: hand.edit("paste", "pot", None, "#00ff00 #00ff00"),
        {POT1: BLUE, POT2: (0, 1, 0)},
    ),
    "edit file on locked": (locked_blue, load_file("learned.json"), {POT1: BLUE}),
    "linked to locked": (
        lambda hand: (locked_blue(hand), hand.link_swatches(LID1, POT1)),
        lambda hand: hand.set_swatch(*LID1, GREEN),
        {POT1: BLUE, POT2: PINK, LID1: GREEN},
    ),
}
BYTE = 0.5 / 255 + 1e-6
# of palettes with 8 bits, and of a solver that is kept a little short
TOLERANCES = dict.fromkeys(("paste", "preset", "palette of GIMP"), BYTE) | {"becomes": 0.01, "fewest": 1e-3}
TOLERANCES |= {"edited becomes": 0.02, "edited becomes by a script": 0.02, "becomes beside bright paint": 0.05}
TOLERANCES |= {"paint after paint": 0.06, "paint on held paint": 0.06}


def state(hand):
    return everything_stored(hand.scene.karf), picture(hand.bpy)


def assert_same(found, wanted):
    assert found[0] == wanted[0]
    assert np.abs(found[1].astype(int) - wanted[1]).max() <= 1  # bytes; sums of changes are rounded


@pytest.mark.parametrize("gesture", GESTURES)
def test_a_gesture_gives_these_colors_and_undo_takes_it_back(bpy, hand, gesture):
    prepare, do, wanted = GESTURES[gesture]
    prepare(hand)
    bpy.ops.ed.undo_push(message="before")
    before = state(hand)
    do(hand)
    after = state(hand)
    tolerance = TOLERANCES.get(gesture, 1e-6)
    for place, learned in LEARNED.items():
        expected = wanted.get(place, learned)
        if expected is not None:
            np.testing.assert_allclose(color(hand.scene, *place), expected, atol=tolerance)
    assert after[0] != before[0]
    bpy.ops.ed.undo_push(message="gesture")
    bpy.ops.ed.undo()
    assert_same(state(hand), before)
    bpy.ops.ed.redo()
    assert_same(state(hand), after)


# gestures that change more than colors; the numbers are those of the richer project
MORE = (
    lambda hand: hand.drag(("pot", 3), GREEN),
    lambda hand: [hand.drag(("pot", 1), (red, 0.5, 0.2)) for red in (0.8, 0.4, 1.1)],
    lambda hand: hand.drag(("lid", 3), BRIGHT),
    lambda hand: hand.lock(("pot", 4)),
    Hand.unlock,
    lambda hand: hand.ops.unlink_swatch(object_name="lid", index=2),
    lambda hand: hand.ops.merge_swatch(object_name="lid", index=1),
    lambda hand: hand.ops.split_swatch(object_name="pot", index=1),
    lambda hand: [hand.surface("pot", 1, saturation=value) for value in (0.3, 1.8)],
    lambda hand: hand.surface("pot", 3, brightness=-0.5, gloss=0.2),
    lambda hand: hand.ops.reset_surface(object_name="pot", index=1),
    lambda hand: setattr(hand.item("pot"), "source", picture(hand.bpy)[8, 20] / 255),
    lambda hand: setattr(hand.item("lid"), "source", picture(hand.bpy)[8, 2] / 255),
    lambda hand: [setattr(hand.item("pot"), "target", (value, 0.4, 0.6)) for value in (0.2, 0.9)],
    lambda hand: hand.toggle(hand.item("pot"), "live"),
    lambda hand: hand.toggle(hand.item("pot"), "is_metal"),
    lambda hand: hand.toggle(hand.scene.karf, "material"),
    lambda hand: hand.toggle(hand.item("pot"), "rule", ("becomes", "fewest")),
    lambda hand: hand.toggle(hand.scene.karf, "compositing", ("delta", "paper")),
    lambda hand: hand.toggle(hand.scene.karf, "active_view", ("photo_0", "photo_1")),
    lambda hand: hand.ops.add_color(object_name="pot", picked=RICH["pot"][3]),
    lambda hand: hand.ops.add_color(object_name="lid", picked=RICH["lid"][1]),
    lambda hand: hand.drag(("pot", 5), BLUE),
    lambda hand: setattr(hand.swatch("pot", 5), "reach", 0.7),
    lambda hand: hand.ops.remove_color(object_name="pot", index=5),
    lambda hand: hand.ops.protect_neutrals(object_name="pot", index=1),
    lambda hand: (setattr(hand.item("pot"), "choke", 1.5), setattr(hand.item("lid"), "feather", 2.5)),
    lambda hand: hand.ops.keep_look(),
    lambda hand: hand.ops.keep_look(name="A"),
    lambda hand: hand.ops.choose_look(name="A"),
    lambda hand: hand.ops.flip_looks(),
)


@pytest.fixture
def undo_steps(bpy):
    """More than there are gestures, all from memory."""
    edit = bpy.context.preferences.edit
    before, edit.undo_steps = edit.undo_steps, 200
    yield
    edit.undo_steps = before


def test_gestures_in_any_order_are_undone_and_redone_to_where_they_began(bpy, addon, hand, undo_steps):
    enrich(bpy, hand.folder / "project")
    for name in ("learned.json", "a.json", "a.gpl", "a.ase"):
        hand.save_edit(hand.folder / name)
    gestures = [each for row in GESTURES.values() for each in row[:2] if each is not nothing] + [*MORE, *MORE]
    gestures += 6 * [Hand.unlock]
    random.Random(1).shuffle(gestures)
    bpy.ops.ed.undo_push(message="begin")
    states, refused = [state(hand)], 0
    for gesture in gestures:
        try:
            gesture(hand)
        except (RuntimeError, addon.steps.KarfError, IndexError, AssertionError) as error:
            assert "Traceback" not in str(error), error  # but a sentence that says why it cannot
            refused += 1
        bpy.ops.ed.undo_push(message="gesture")
        states.append(state(hand))
    assert refused < len(gestures) / 4
    for wanted in reversed(states[:-1]):
        bpy.ops.ed.undo()
        assert_same(state(hand), wanted)
    for wanted in states[1:]:
        bpy.ops.ed.redo()
        assert_same(state(hand), wanted)


def test_one_color_travels_as_text(hand):
    assert hand.edit("copied", *POT1) == "#cc331a"
    hand.edit("paste", "lid", 1, "#cc331a")
    np.testing.assert_allclose(color(hand.scene, *LID1) * 255, (204, 51, 26), atol=1e-3)


@pytest.mark.parametrize("suffix", [".gpl", ".ase"])
def test_a_palette_of_another_program_leaves_the_way_of_compositing(hand, suffix):
    keep_file(f"a{suffix}", TEAL)(hand)
    hand.scene.karf.compositing = "paper"
    hand.apply_edit(hand.folder / f"a{suffix}")
    assert hand.scene.karf.compositing == "paper"


def test_becomes_moves_merged_swatches_as_one(hand):
    hand.merge_swatch(*POT2, 1)
    hand.becomes("pot", RED, (0.5, 0.4, 0.3))
    moved = color(hand.scene, *POT1) - RED
    np.testing.assert_allclose(color(hand.scene, *POT2) - YELLOW, moved, atol=1e-6)
    assert np.abs(moved).max() > 0.1


REFUSED = (
    ("Objects: lid, pot", lambda hand: hand.set_swatch("kettle", 1, "#ffffff")),
    ("no swatch 0", lambda hand: hand.set_swatch("pot", 0, "#ffffff")),
    ("'photo_9'", lambda hand: hand.show_view("photo_9").wait()),
    ("no color", lambda hand: hand.edit("paste", "lid", None, "no color at all")),
    ("black", lambda hand: hand.add_color("pot", (0, 0, 0))),
    ("merged into 1", lambda hand: hand.set_swatch(*POT2, BLUE)),
    ("cannot be linked with that swatch", lambda hand: hand.link_swatches(POT1, POT2)),
    ("cannot be merged into another", lambda hand: hand.merge_swatch(*POT1)),
    ("cannot be merged into 3", lambda hand: hand.merge_swatch(*LID1, 3)),
    ("is an added color", lambda hand: hand.merge_swatch("pot", 3)),
    ("is a learned color", lambda hand: hand.remove_color(*POT1)),
    ("added to pot", lambda hand: hand.save_edit(hand.folder / "pots.gpl")),
    ("gloss", lambda hand: hand.set_surface(*POT1, gloss=-1.0)),
    ("pot shows no color like #00ff00", lambda hand: hand.becomes("pot", (0, 1, 0), BLUE)),
)
LOCKED = (
    lambda hand: hand.set_swatch(*POT1, GREEN),
    lambda hand: hand.set_surface(*POT1, gloss=0.0),
    lambda hand: hand.edit("reset", *POT1),
    lambda hand: hand.edit("swap", LID1, POT1),
    lambda hand: hand.edit("paste", *POT1, "#00ff00"),
    lambda hand: hand.link_swatches(POT1, LID2),
    lambda hand: hand.merge_swatch(*POT1, 2),
    lambda hand: hand.remove_color("pot", 3),
    lambda hand: hand.apply_edit(hand.folder / "without.json"),  # which has no added color
)


def test_refusals_say_why_and_change_nothing(addon, hand):
    merge(hand)
    assert hand.add_color("pot", YELLOW, BLUE) == 3
    before = state(hand)
    for sentence, tool in REFUSED:
        with pytest.raises(addon.steps.KarfError, match=sentence):
            tool(hand)
    assert_same(state(hand), before)


def test_no_tool_changes_a_locked_swatch(addon, hand):
    hand.save_edit(hand.folder / "without.json")
    hand.add_color("pot", YELLOW, BLUE)
    hand.set_swatch(*POT1, GREEN)
    hand.lock(POT1, ("pot", 3))
    before = state(hand)
    for tool in LOCKED:
        with pytest.raises(addon.engine_api.BadRequest, match="locked"):
            tool(hand)
    assert_same(state(hand), before)
