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
def _nothing(bpy):
    pass


def _drag_linked(bpy):
    for share in (0.3, 0.6, 1.0):
        bpy.context.scene.karf.objects["pot"].swatches[4].color = (
            0.9 - 0.5 * share,
            0.8 - 0.3 * share,
            0.3 + 0.4 * share,
        )


def _drag_leader_of_merged(bpy):
    for share in (0.3, 0.6, 1.0):
        bpy.context.scene.karf.objects["pot"].swatches[1].color = (0.8 * (1 - share), 0.2 + 0.4 * share, 0.5 * share)


def _drag_added(bpy):
    lid = bpy.context.scene.karf.objects["lid"]
    next(swatch for swatch in lid.swatches if swatch.is_added).color = (0.7, 0.3, 0.5)


def _drag_target(bpy):
    pot = bpy.context.scene.karf.objects["pot"]
    pot.live = True
    pot.target = (0.5, 0.25, 0.6)
    pot.target = (0.3, 0.25, 0.6)


def _press_becomes(bpy):
    bpy.context.scene.karf.objects["pot"].target = (0.2, 0.6, 0.7)
    bpy.ops.karf.becomes(object_name="pot")


def _choose_other_look(bpy):
    bpy.ops.karf.choose_look(name="Night")


def _flip(bpy):
    bpy.ops.karf.flip_looks()


def _split(bpy):
    bpy.ops.karf.split_swatch(object_name="pot", index=1)
    bpy.context.scene.karf.objects["pot"].swatches[1].color = (0.3, 0.3, 0.9)


def _reset(bpy):
    bpy.ops.karf.reset_swatch(object_name="pot")
    bpy.ops.karf.reset_swatch(object_name="lid")


def _remove_added(bpy):
    lid = bpy.context.scene.karf.objects["lid"]
    index = next(number for number, swatch in enumerate(lid.swatches) if swatch.is_added)
    bpy.ops.karf.remove_color(object_name="lid", index=index)


def _show_other_view(bpy):
    bpy.context.scene.karf.active_view = "photo_1"


def _compositing(bpy):
    bpy.context.scene.karf.compositing = "delta"


def _at_frame(frame):
    return lambda bpy: bpy.context.scene.frame_set(frame)


TRIALS = {
    "opened": _nothing,
    **{f"frame {frame}": _at_frame(frame) for frame in FRAMES},
    "linked swatch dragged": _drag_linked,
    "leader of a merged swatch dragged": _drag_leader_of_merged,
    "added color dragged": _drag_added,
    "target dragged": _drag_target,
    "becomes pressed": _press_becomes,
    "other look chosen": _choose_other_look,
    "looks flipped": _flip,
    "split": _split,
    "reset": _reset,
    "added color removed": _remove_added,
    "other view shown": _show_other_view,
    "compositing of the photo": _compositing,
}


def tried(bpy, blend, trial, folder):
    """Open a file, do something to it, and tell what there is then: values, and the picture."""
    bpy.ops.wm.read_homefile(use_empty=True)
    bpy.ops.wm.open_mainfile(filepath=str(blend))
    TRIALS[trial](bpy)
    karf = bpy.context.scene.karf
    told = {"colors": colors(bpy), "shown": palettes_shown(bpy, folder), "look": karf.look}
    return told, picture(bpy)
