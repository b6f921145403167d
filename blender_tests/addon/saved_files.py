"""Opens, edits and reads files saved by earlier versions, data/saved_by_<version>/ (see data/make_saved_file.py).

It uses only what a .blend file, a script or a button can do, to run in any version.
"""

import json
from pathlib import Path

import numpy as np

DATA = Path(__file__).parent / "data"
FRAMES = (1, 4, 11)
# not stored in the file, or a pointer to data compared elsewhere
LEFT_OUT = {"rna_type", "project", "capture", "masks", "out", "frames"}


def everything_stored(group):
    """All properties of a group and of those within it, as JSON values; pointers by name."""
    found = {}
    for prop in group.bl_rna.properties:
        if prop.identifier in LEFT_OUT:
            continue
        value = getattr(group, prop.identifier)
        if prop.type == "COLLECTION":
            value = [everything_stored(each) for each in value]
        elif prop.type == "POINTER":
            is_group = value is not None and prop.fixed_type.identifier.startswith("KARF_PG_")
            value = everything_stored(value) if is_group else value and value.name
        elif prop.type in {"FLOAT", "INT", "BOOLEAN"} and prop.is_array:
            value = [round(each, 6) for each in value]
        elif prop.type == "FLOAT":
            value = round(value, 6)
        found[prop.identifier] = value
    return found


def picture(bpy):
    """The recolored picture, [H, W, 3] bytes."""
    image = bpy.context.scene.karf.result
    pixels = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(pixels)
    return np.rint(pixels.reshape(image.size[1], image.size[0], -1)[..., :3] * 255).clip(0, 255).astype(np.uint8)


def colors(bpy):
    """The colors of all swatches, by object."""
    objects = bpy.context.scene.karf.objects
    return {item.name: [[round(each, 6) for each in swatch.color] for swatch in item.swatches] for item in objects}


def _item(bpy, name):
    return bpy.context.scene.karf.objects[name]


def _added(bpy):
    """The lid's first added color, and its number."""
    return next((number, each) for number, each in enumerate(_item(bpy, "lid").swatches) if each.is_added)


def _drag(bpy, index, start, end):
    """Drag a swatch of the pot in three steps."""
    for share in (0.3, 0.6, 1.0):
        _item(bpy, "pot").swatches[index].color = [a + share * (b - a) for a, b in zip(start, end, strict=True)]


def _drag_target(bpy):
    pot = _item(bpy, "pot")
    pot.live = True
    pot.target = (0.5, 0.25, 0.6)
    pot.target = (0.3, 0.25, 0.6)


def _press_becomes(bpy):
    _item(bpy, "pot").target = (0.2, 0.6, 0.7)
    bpy.ops.karf.becomes(object_name="pot")


def _split(bpy):
    bpy.ops.karf.split_swatch(object_name="pot", index=1)
    _item(bpy, "pot").swatches[1].color = (0.3, 0.3, 0.9)


def _reset(bpy):
    for name in ("pot", "lid"):
        bpy.ops.karf.reset_swatch(object_name=name)


TRIALS = {
    "opened": lambda bpy: None,
    **{f"frame {frame}": lambda bpy, frame=frame: bpy.context.scene.frame_set(frame) for frame in FRAMES},
    "linked swatch dragged": lambda bpy: _drag(bpy, 4, (0.9, 0.8, 0.3), (0.4, 0.5, 0.7)),
    "leader of a merged swatch dragged": lambda bpy: _drag(bpy, 1, (0.8, 0.2, 0.0), (0.0, 0.6, 0.5)),
    "added color dragged": lambda bpy: setattr(_added(bpy)[1], "color", (0.7, 0.3, 0.5)),
    "target dragged": _drag_target,
    "becomes pressed": _press_becomes,
    "other look chosen": lambda bpy: bpy.ops.karf.choose_look(name="Night"),
    "looks flipped": lambda bpy: bpy.ops.karf.flip_looks(),
    "split": _split,
    "reset": _reset,
    "added color removed": lambda bpy: bpy.ops.karf.remove_color(object_name="lid", index=_added(bpy)[0]),
    "other view shown": lambda bpy: setattr(bpy.context.scene.karf, "active_view", "photo_1"),
    "compositing of the photo": lambda bpy: setattr(bpy.context.scene.karf, "compositing", "delta"),
}


def run_trial(bpy, blend, trial, folder):
    """Open a file, run a trial, and return the values and the picture that result."""
    bpy.ops.wm.read_homefile(use_empty=True)
    bpy.ops.wm.open_mainfile(filepath=str(blend))
    TRIALS[trial](bpy)
    bpy.ops.karf.save_edit(filepath=str(folder / "shown.json"))
    shown, look = json.loads((folder / "shown.json").read_text()), bpy.context.scene.karf.look
    return {"colors": colors(bpy), "shown": shown, "look": look}, picture(bpy)
