"""Any gestures undone and redone: each state comes back, with its picture."""

import random

import numpy as np
import pytest

from ..rich_project import HEIGHT, LEARNED, VIEWS, enrich
from ..saved_files import everything_stored, picture

GESTURES = 200
COLUMNS = {"lid": range(10), "pot": range(14, 24)}  # of the picture, in which an object is alone


class Artist:
    """Does something by chance to the swatches of the open scene; every gesture is one that Blender can undo."""

    def __init__(self, bpy, addon, seed):
        self.bpy, self.addon, self.random = bpy, addon, random.Random(seed)

    @property
    def karf(self):
        return self.bpy.context.scene.karf

    def some_color(self, highest=1.0):
        return [self.random.uniform(0, highest) for _ in range(3)]

    def some_object(self):
        return self.random.choice(self.karf.objects)

    def some_swatch(self):
        """An object, and the number of a swatch of it that is displayed."""
        item = self.some_object()
        shown = [number for number, each in enumerate(item.swatches) if number and not each.merged]
        return item, self.random.choice(shown)

    def named(self):
        item, index = self.some_swatch()
        return {"object_name": item.name, "index": index}

    def other_named(self):
        item, index = self.some_swatch()
        return {"other_name": item.name, "other_index": index}

    # --- gestures --------------------------------------------------------------------------------------------------
    def drag(self):
        item, index = self.some_swatch()
        start, end = np.array(item.swatches[index].color), np.array(self.some_color(1.2))
        if item.swatches[index].locked:  # the panel has its color grayed out
            return
        for share in (0.3, 0.7, 1.0):
            item.swatches[index].color = start + share * (end - start)

    def lock(self):
        item, index = self.some_swatch()
        item.swatches[index].locked = not item.swatches[index].locked

    def link(self):
        self.bpy.ops.karf.link_swatches(**self.named(), **self.other_named())

    def unlink(self):
        self.bpy.ops.karf.unlink_swatch(**self.named())

    def merge(self):
        self.bpy.ops.karf.merge_swatch(**self.named())

    def split(self):
        self.bpy.ops.karf.split_swatch(**self.named())

    def surface(self):
        item, index = self.some_swatch()
        name, lowest, highest = self.random.choice([("saturation", 0, 2), ("brightness", -1, 1), ("gloss", 0, 2)])
        for _ in range(2):
            setattr(item.swatches[index], name, self.random.uniform(lowest, highest))

    def reset_surface(self):
        self.bpy.ops.karf.reset_surface(**self.named())

    def pick_source(self):
        item = self.some_object()
        row, column = self.random.randrange(HEIGHT), self.random.choice(COLUMNS[item.name])
        item.source = picture(self.bpy)[row, column] / 255

    def becomes(self):
        item = self.some_object()
        item.target = self.some_color()
        self.bpy.ops.karf.becomes(object_name=item.name)

    def switch_live(self):
        item = self.some_object()
        item.live = not item.live

    def drag_target(self):
        item = self.some_object()
        for _ in range(2):
            item.target = self.some_color()

    def rule(self):
        item = self.some_object()
        item.rule = "fewest" if item.rule == "becomes" else "becomes"

    def metal(self):
        item = self.some_object()
        item.is_metal = not item.is_metal

    def material(self):
        self.karf.material = not self.karf.material

    def add_color(self):
        item = self.some_object()
        self.bpy.ops.karf.add_color(object_name=item.name, picked=self.random.choice(LEARNED[item.name][1:]))

    def remove_color(self):
        item = self.some_object()
        added = [number for number, each in enumerate(item.swatches) if each.is_added]
        if added:
            self.bpy.ops.karf.remove_color(object_name=item.name, index=self.random.choice(added))

    def reach(self):
        added = [each for item in self.karf.objects for each in item.swatches if each.is_added]
        if added:
            self.random.choice(added).reach = self.random.uniform(0.2, 2)

    def protect_neutrals(self):
        self.bpy.ops.karf.protect_neutrals(**self.named())

    def reset(self):
        self.bpy.ops.karf.reset_swatch(**self.named())

    def reset_all(self):
        self.bpy.ops.karf.reset_swatch(object_name=self.some_object().name)

    def swap(self):
        self.bpy.ops.karf.swap_swatches(**self.named(), **self.other_named())

    def paste(self):
        self.some_object().palette = "#3366cc #aa5511"

    def edge(self):
        item = self.some_object()
        item.choke, item.feather = self.random.uniform(-1, 2), self.random.choice([0, self.random.uniform(0, 3)])

    def keep_look(self):
        names = self.karf.looks.keys()
        self.bpy.ops.karf.keep_look(name=self.random.choice(names) if len(names) > 2 else "")

    def choose_look(self):
        if self.karf.looks:
            self.bpy.ops.karf.choose_look(name=self.random.choice(self.karf.looks.keys()))

    def flip_looks(self):
        if self.bpy.ops.karf.flip_looks.poll():
            self.bpy.ops.karf.flip_looks()

    def compositing(self):
        self.karf.compositing = "paper" if self.karf.compositing == "delta" else "delta"

    def view(self):
        self.karf.active_view = self.random.choice(VIEWS)


OFTEN = {"drag": 12, "surface": 4, "becomes": 4, "drag_target": 4, "lock": 2, "pick_source": 3}
NAMES = [name for name, value in vars(Artist).items() if callable(value) and not name.startswith("_")]
NAMES = [name for name in NAMES if not name.startswith("some_") and not name.endswith("named")]


def state(bpy):
    return everything_stored(bpy.context.scene.karf), picture(bpy)


def differences(found, wanted):
    """What is otherwise, in words."""
    stored = [name for name, value in wanted[0].items() if found[0][name] != value]
    different = [
        (item["name"], number, name, swatch[name], known)
        for item, own in zip(found[0]["objects"], wanted[0]["objects"], strict=False)
        for number, (swatch, old) in enumerate(zip(item["swatches"], own["swatches"], strict=False))
        for name, known in old.items()
        if swatch[name] != known
    ]
    if (most := np.abs(found[1].astype(int) - wanted[1]).max()) > 1:  # bytes; sums of changes are rounded
        stored.append(f"picture by {most}")
    return stored, different[:4]


@pytest.fixture
def undo_steps(bpy):
    """As many as there are gestures, all from memory."""
    edit = bpy.context.preferences.edit
    before, edit.undo_steps = edit.undo_steps, GESTURES + 5
    yield
    edit.undo_steps = before


@pytest.mark.parametrize("seed", [1])
def test_gestures_are_undone_and_redone_to_where_they_began(bpy, addon, learned, undo_steps, tmp_path, seed):
    enrich(bpy, tmp_path / "project")
    artist = Artist(bpy, addon, seed)
    names = [*NAMES, *artist.random.choices(NAMES, [OFTEN.get(name, 1) for name in NAMES], k=GESTURES - len(NAMES))]
    artist.random.shuffle(names)
    bpy.ops.ed.undo_push(message="begin")
    states, refused = [state(bpy)], 0
    for name in names:
        try:
            getattr(artist, name)()
        except RuntimeError as error:  # a button that says why it cannot
            assert "Traceback" not in str(error), error
            refused += 1
        bpy.ops.ed.undo_push(message=name)
        states.append(state(bpy))
    assert refused < GESTURES / 4
    for number in reversed(range(GESTURES)):
        bpy.ops.ed.undo()
        assert differences(state(bpy), states[number]) == ([], []), f"undid {names[number]}, gesture {number + 1}"
    for number in range(1, GESTURES + 1):
        bpy.ops.ed.redo()
        assert differences(state(bpy), states[number]) == ([], []), f"redid {names[number - 1]}, gesture {number}"
