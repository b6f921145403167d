"""Steps 1 to 3: the capture, masks, and what is learned."""

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
from ..workspace import estimates, states
from .display import draw_advanced, draw_masks, draw_render_learned, draw_space, draw_view


def draw_import(layout, context):
    """Draw step 1; before anything is imported, also what is missing to continue."""
    karf = context.scene.karf
    layout.operator("karf.import_capture", icon="IMPORT")
    if not karf.project:
        layout.operator("karf.find_poses", icon="CON_CAMERASOLVER")
        _draw_engine(layout)
    _draw_advice(layout, karf)
    body = draw_advanced(layout, "import")
    if body is None:
        return
    if karf.project:
        body.operator("karf.find_poses", icon="CON_CAMERASOLVER")
    body.operator("karf.import_splat", icon="OUTLINER_OB_POINTCLOUD")
    if not karf.project:
        return
    row = body.row(align=True)
    row.operator("karf.look_through", text=karf.active_view, icon="VIEW_CAMERA", translate=False)
    row.prop(karf.looking, "hides_others", text="", icon="HIDE_ON" if karf.looking.hides_others else "HIDE_OFF")
    row.operator("karf.leave_view", text="", icon="LOOP_BACK")
    _draw_photos(body, karf)
    body.operator("karf.check_capture", icon="VIEWZOOM")
    row = body.row(align=True)
    row.prop(karf, "project")
    row.operator("karf.open_folder", text="", icon="FILEBROWSER").folder = "project"
    if bpy.data.filepath and moving.is_hidden(context.scene):
        body.operator("karf.move_project", icon="FILE_FOLDER")
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
    """Draw step 3: what varies in height stands below the buttons, which stay under the mouse."""
    scene, karf = context.scene, context.scene.karf
    layout.prop(karf, "preset")
    _draw_timed(layout, scene, "learn_all", "PLAY")
    draw_text(layout, states.state_of(scene, "learn").reason, "FILE_REFRESH")
    if karf.is_poor:
        draw_text(layout, karf.advice.splitlines()[0], "ERROR")
    if karf.project:
        _draw_engine(layout)
    body = draw_advanced(layout, "learn")
    if body is None:
        return
    _draw_timed(body, scene, "learn_scene", "OUTLINER_OB_VOLUME")
    body.prop(karf, "nerf", text="NeRF")  # the whole name does not fit
    _draw_segment(body, context)
    body.operator("karf.extract_palette", icon="COLOR")


def _draw_timed(layout, scene, name, icon):
    """Draw the button of a job, and below it always one line: how long it takes on this computer, if that is known."""
    column = layout.column(align=True)
    column.operator(f"karf.{name}", icon=icon)
    seconds = estimates.seconds(scene.karf.preset, name, is_open=scene.karf.n_points > 0)
    column.label(**{"text": "", "icon": "BLANK1"} if seconds is None else {"text": duration(seconds), "icon": "TIME"})


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


def _draw_segment(layout, context):
    layout.operator("karf.segment", icon="MOD_MASK")
    known = disk.contents_of(context.scene)
    if "segmentation" not in known.stages:
        return
    if not context.scene.karf.objects:  # then step 4 has them
        draw_masks(layout, context)
    _draw_unsure(layout, context, known)


def _draw_unsure(layout, context, known):
    # this does not measure the quality of the masks
    for name, share, is_unseen in known.unsure:
        shown = {"name": name, "share": f"{100 * share:.0f}"}
        if is_unseen:
            text = translate("{name}: {share} % unsure, not visible in any marked view", **shown)
        else:
            text = translate("{name}: {share} % unsure, marks and colors disagree", **shown)
        draw_text(layout, text, "QUESTION")
    if known.unsure and not context.scene.karf.objects:  # then step 4 has it
        layout.prop_enum(context.window_manager.karf_seeing, "mode", "UNSURE")
        draw_render_learned(layout, context)


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
    draw_view(layout, scene.karf)
    layout.operator("karf.mark", icon="RESTRICT_SELECT_OFF")
    if queries.is_waiting("propose") or queries.is_waiting("correct"):
        layout.label(text="The engine is working", icon="SORTTIME")
    else:
        layout.label(text="Ctrl: exclude from the object" if marking.correct else "Ctrl: take away", icon="MOUSE_LMB")
    if state.known().problem:
        draw_text(layout, "Without the engine, a box marks a rectangle and clicks do nothing.", "INFO")
    body = draw_advanced(layout, "mark")
    if body is None:
        return
    row = body.row(align=True)
    for icon, by, marked in (("TRIA_LEFT", -1, False), ("TRIA_RIGHT", 1, False), ("FF", 1, True)):
        button = row.operator("karf.go_to_view", text="", icon=icon)
        button.by, button.marked = by, marked
    body.prop(marking, "brush")
    body.operator_menu_enum("karf.set_volume", "kind", icon="CUBE")
    known = disk.contents_of(scene)
    if "segmentation" in known.stages:
        body.prop(marking, "correct", toggle=True, icon="BRUSH_DATA")
        suggested = known.suggested
        text = translate("Mark next: {view}", view=suggested[0]) if suggested else translate("Suggested View")
        body.operator("karf.go_to_suggested", text=text, icon="LIGHT")
        if known.any_view_helps:
            body.label(text="All views would help about equally", icon="BLANK1")
    body.operator("karf.erase_mask", icon="X", text="Erase Correction" if marking.correct else "Erase Mask")
    body.prop(scene.karf, "masks")
