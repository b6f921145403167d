"""The quality of splats: what to learn, what was reached, and floaters to delete."""

from ..host.words import draw_text, translatable, translate
from ..project import disk

REACHED = {  # by the engine's word
    "sharp": translatable("{quality}: new views are sharp, like photos blurred by {blur} pixels"),
    "soft": translatable("{quality}: new views are soft, like photos blurred by {blur} pixels"),
    "poor": translatable("{quality}: new views are poor, like photos blurred by {blur} pixels"),
}


def draw_splats(layout, scene):
    known = disk.contents_of(scene)
    if "geometry" not in known.stages:
        return
    layout.row(align=True).prop(scene.karf, "splat_quality", expand=True)
    layout.operator("karf.learn_splats", icon="SHADERFX")
    if "splats" not in known.stages:
        return
    row = layout.row(align=True)
    row.operator("karf.add_delete_box", icon="CUBE")
    row.operator("karf.delete_inside", icon="TRASH")
    if known.erased:
        layout.operator("karf.restore_splats", icon="LOOP_BACK")
    quality, word, blur = known.reached
    if word in REACHED:
        shown = {"quality": translate(quality.capitalize()), "blur": f"{blur:.1f}"}
        draw_text(layout, translate(REACHED[word], **shown), "ERROR" if word == "poor" else "INFO")
    elif quality:
        text = translatable("{quality}: not measured, for no photos were held out")
        draw_text(layout, translate(text, quality=translate(quality.capitalize())), "INFO")
