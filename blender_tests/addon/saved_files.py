"""Files that a version has saved, and what it shows of them: data/saved_by_<version>/, written by data/make_saved_file.py.

Whatever saves or opens such a file here uses only what a .blend, a script or a button does, and so runs in any version.
"""

import json
from pathlib import Path

import numpy as np

DATA = Path(__file__).parent / "data"
FRAMES = (1, 4, 11)
# of the session and not of the file, or pointers to what the rest tells
LEFT_OUT = {"rna_type", "project", "capture", "masks", "out", "frames"}


def everything_stored(group):
    """All properties of a group, those of its groups and collections too, as JSON has them; pointers by name."""
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


def palettes_shown(bpy, folder):
    """The palette of each object as the picture shows it, and all else of an edit file."""
    path = Path(folder) / "shown.json"
    bpy.ops.karf.save_edit(filepath=str(path))
    return json.loads(path.read_text())


def picture(bpy):
    """The recolored picture, [H, W, 3] bytes."""
    image = bpy.context.scene.karf.result
    pixels = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(pixels)
    return np.rint(pixels.reshape(image.size[1], image.size[0], -1)[..., :3] * 255).clip(0, 255).astype(np.uint8)


def colors(bpy):
    """The colors that all swatches were given."""
    objects = bpy.context.scene.karf.objects
    return {item.name: [[round(each, 6) for each in swatch.color] for swatch in item.swatches] for item in objects}


# --- what is done to an opened file --------------------------------------------------------------------------------
def _lid(bpy):
    return bpy.context.scene.karf.objects["lid"]


def _pot(bpy):
    return bpy.context.scene.karf.objects["pot"]


def _added(bpy):
    """The lid's first added color, and its number."""
    return next((number, each) for number, each in enumerate(_lid(bpy).swatches) if each.is_added)


def _drag(bpy, index, start, end):
    """Drag a swatch of the pot over some colors."""
    for share in (0.3, 0.6, 1.0):
        _pot(bpy).swatches[index].color = [a + share * (b - a) for a, b in zip(start, end, strict=True)]


def _drag_target(bpy):
    pot = _pot(bpy)
    pot.live = True
    pot.target = (0.5, 0.25, 0.6)
    pot.target = (0.3, 0.25, 0.6)


def _press_becomes(bpy):
    _pot(bpy).target = (0.2, 0.6, 0.7)
    bpy.ops.karf.becomes(object_name="pot")


def _split(bpy):
    bpy.ops.karf.split_swatch(object_name="pot", index=1)
    _pot(bpy).swatches[1].color = (0.3, 0.3, 0.9)


def _reset(bpy):
    for name in ("pot", "lid"):
        bpy.ops.karf.reset_swatch(object_name=name)


def _at_frame(frame):
    return lambda bpy: bpy.context.scene.frame_set(frame)


TRIALS = {
    "opened": lambda bpy: None,
    **{f"frame {frame}": _at_frame(frame) for frame in FRAMES},
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


def tried(bpy, blend, trial, folder):
    """Open a file, do something to it, and tell what there is then: values, and the picture."""
    bpy.ops.wm.read_homefile(use_empty=True)
    bpy.ops.wm.open_mainfile(filepath=str(blend))
    TRIALS[trial](bpy)
    karf = bpy.context.scene.karf
    told = {"colors": colors(bpy), "shown": palettes_shown(bpy, folder), "look": karf.look}
    return told, picture(bpy)
