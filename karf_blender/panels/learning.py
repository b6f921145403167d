"""Steps 1 to 5: the capture, masks, and what is learned."""

import bpy

from ... import __package__ as extension
from ..engine import installing
from ..host.words import draw_text, translate
from ..marking import objects
from ..pictures import tints
from ..preferences import state
from ..project import disk, moving
from ..rig import reprojection
from ..tasks import queries
from ..workspace import estimates
from .display import draw_advanced, draw_masks, draw_render_learned, draw_space, draw_view


def draw_import(layout, context):
    """Draw step 1; before anything is imported, also what is missing to continue."""
    karf = context.scene.karf
    if not karf.project:
        _draw_engine(layout)
    layout.operator("karf.import_capture", icon="IMPORT")
    layout.operator("karf.find_poses", icon="CON_CAMERASOLVER")
    layout.operator("karf.import_splat", icon="OUTLINER_OB_POINTCLOUD")
    if not karf.project:
        return
    row = layout.row(align=True)
    row.operator("karf.look_through", text=karf.active_view, icon="VIEW_CAMERA", translate=False)
    row.prop(karf.looking, "hides_others", text="", icon="HIDE_ON" if karf.looking.hides_others else "HIDE_OFF")
    row.operator("karf.leave_view", text="", icon="LOOP_BACK")
    _draw_photos(layout, karf)
    _draw_advice(layout, karf)
    row = layout.row(align=True)
    row.prop(karf, "project")
    row.operator("karf.open_folder", text="", icon="FILEBROWSER").folder = "project"
    if bpy.data.filepath and moving.is_hidden(context.scene):
        layout.operator("karf.move_project", icon="FILE_FOLDER")
    body = draw_advanced(layout, "import")
    if body is not None:
        _draw_reprojection(body, context.scene)
        draw_space(body, karf, "photo_space")


class KARF_UL_views(bpy.types.UIList):
    """The captured photos, and which of them are learned from. A click shows one"""

    def draw_item(self, context, layout, data, item, icon, active_data, active_property, index):
        row = layout.row(align=True)
        check = row.row()
        check.active = item.split == "train"
        check.prop(item, "is_learned", text="")
        row.label(text=item.name, translate=False)
        if item.is_blurred:
            row.label(text="blurred", icon="ERROR")
        elif item.split != "train":
            row.label(text="to test")


def _draw_photos(layout, karf):
    header, body = layout.panel("karf_photos", default_closed=True)
    header.label(text=_photo_counts(karf.views))
    if body is not None:
        body.template_list("KARF_UL_views", "", karf, "views", karf, "active_number", rows=5)
        body.operator("karf.leave_out_blurred", icon="X")


def _photo_counts(views) -> str:
    n_learned = sum(view.split == "train" and view.is_learned for view in views)
    if n_learned == len(views):
        return translate("{count} photos, all to learn", count=len(views))
    return translate("{learned} of {count} photos to learn", learned=n_learned, count=len(views))


def _draw_advice(layout, karf):
    layout.operator("karf.check_capture", icon="VIEWZOOM")
    if queries.is_waiting("inspect"):
        layout.label(text="The engine is working", icon="SORTTIME")
        return
    sentence, *findings = karf.advice.splitlines() or [""]
    draw_text(layout, sentence, "ERROR" if karf.is_poor else "INFO")
    for finding in findings:
        draw_text(layout, finding, "DOT")


def _draw_reprojection(layout, scene):
    if not scene.karf.n_points:
        layout.label(text="There are no sparse points to check the cameras with")
        return
    layout.prop(scene.karf, "show_reprojection")
    known = reprojection.of_camera(scene, scene.camera)
    if known is None:
        layout.label(text="Look through a view to see its errors")
    elif not known.summary.count:
        layout.label(text="This photo shows no known point")
    else:
        draw_text(layout, str(known.summary), "BLANK1")


def draw_learn(layout, context):
    if context.scene.karf.is_poor:
        draw_text(layout, context.scene.karf.advice.splitlines()[0], "ERROR")
    layout.prop(context.scene.karf, "preset")
    if context.scene.karf.project:
        _draw_engine(layout)
    for name, icon in (("learn_scene", "OUTLINER_OB_VOLUME"), ("learn_all", "PLAY")):
        column = layout.column(align=True)
        column.operator(f"karf.{name}", icon=icon)
        seconds = estimates.seconds(context.scene.karf.preset, name, is_open=context.scene.karf.n_points > 0)
        if seconds is not None:
            column.label(text=duration(seconds), icon="TIME")
    body = draw_advanced(layout, "learn")
    if body is not None:
        body.prop(context.scene.karf, "nerf", text="NeRF")  # the whole name does not fit


def duration(seconds):
    """About so long, as one says it."""
    minutes = max(1, round(seconds / 60))
    if minutes >= 90:
        return translate("About {count} hours on this computer", count=round(minutes / 60))
    if minutes == 1:
        return translate("About a minute on this computer")
    return translate("About {count} minutes on this computer", count=minutes)


def _draw_engine(layout):
    problem = state.known().problem
    if installing.is_running():
        progress = installing.progress()
        layout.progress(factor=progress.fraction, text=translate("Engine: {what}", what=progress.title))
    elif problem:
        draw_text(layout, problem, "INFO")
    if problem or installing.is_running():
        layout.operator("preferences.addon_show", text="KaRF Preferences", icon="PREFERENCES").module = extension


def draw_segment(layout, context):
    layout.operator("karf.segment", icon="MOD_MASK")
    known = disk.contents_of(context.scene)
    if "segmentation" not in known.stages:
        return
    if not context.scene.karf.objects:  # then step 6 has them
        draw_masks(layout, context)
    body = draw_advanced(layout, "segment") if known.unsure else None
    if body is not None:
        _draw_unsure(body, context, known)


def _draw_unsure(layout, context, known):
    # this does not measure the quality of the masks
    for name, share, is_unseen in known.unsure:
        shown = {"name": name, "share": f"{100 * share:.0f}"}
        if is_unseen:
            text = translate("{name}: {share} % unsure, not visible in any marked view", **shown)
        else:
            text = translate("{name}: {share} % unsure, marks and colors disagree", **shown)
        draw_text(layout, text, "QUESTION")
    if not context.scene.karf.objects:  # then step 6 has it
        layout.prop_enum(context.window_manager.karf_seeing, "mode", "UNSURE")
        draw_render_learned(layout, context)


def draw_palette(layout, context):
    layout.operator("karf.extract_palette", icon="COLOR")


class KARF_UL_objects(bpy.types.UIList):
    """The objects to mark: their colors, names and numbers of masks."""

    def draw_item(self, context, layout, data, item, icon, active_data, active_property, index):
        row = layout.row(align=True)
        row.label(text="", icon_value=tints.icon(objects.tint(item)))
        row.prop(item, "name", text="", emboss=False)
        count = disk.contents_of(context.scene).masks.get(item.folder, 0)
        row.label(text=translate("{count} marked", count=count) if count else "not marked")


def draw_mark(layout, context):
    scene, marking = context.scene, context.scene.karf.marking
    row = layout.row()
    row.template_list("KARF_UL_objects", "", marking, "objects", marking, "active", rows=3)
    column = row.column(align=True)
    column.operator("karf.add_object", text="", icon="ADD")
    column.operator("karf.remove_object", text="", icon="REMOVE")
    _draw_view_steps(layout, scene)
    layout.operator("karf.mark", icon="RESTRICT_SELECT_OFF")
    layout.label(text="Ctrl: exclude from the object" if marking.correct else "Ctrl: take away", icon="MOUSE_LMB")
    layout.prop(marking, "brush")
    layout.operator_menu_enum("karf.set_volume", "kind", icon="CUBE")
    known = disk.contents_of(scene)
    if "segmentation" in known.stages:
        layout.prop(marking, "correct", toggle=True, icon="BRUSH_DATA")
        suggested = known.suggested
        text = translate("Mark next: {view}", view=suggested[0]) if suggested else translate("Suggested View")
        layout.operator("karf.go_to_suggested", text=text, icon="LIGHT")
        if known.any_view_helps:
            layout.label(text="All views would help about equally", icon="BLANK1")
    layout.operator("karf.erase_mask", icon="X", text="Erase Correction" if marking.correct else "Erase Mask")
    if state.known().problem:
        draw_text(layout, "Without the engine, a box marks a rectangle and clicks do nothing.", "INFO")
    if queries.is_waiting("propose") or queries.is_waiting("correct"):
        layout.label(text="The engine is working", icon="SORTTIME")
    layout.prop(scene.karf, "masks")


def _draw_view_steps(layout, scene):
    row = layout.row(align=True)
    draw_view(row, scene.karf)
    for icon, by, marked in (("TRIA_LEFT", -1, False), ("TRIA_RIGHT", 1, False), ("FF", 1, True)):
        button = row.operator("karf.go_to_view", text="", icon=icon)
        button.by, button.marked = by, marked
