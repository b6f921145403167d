"""Steps 1, 2, 4 and 5: the capture, and what is learned of it."""

import bpy

from ... import __package__ as extension
from ..engine import installing
from ..host.labels import draw_text
from ..host.words import translate
from ..preferences import state
from ..project import disk, moving
from ..rig import reprojection
from ..tasks import queries
from ..workspace import estimates
from .seeing import draw_lacking, draw_masks
from .views import draw_advanced, draw_space


def draw_import(layout, context):
    """Step 1; where nothing is imported yet, it also says what is missing to continue."""
    karf = context.scene.karf
    if not karf.project:
        draw_engine(layout)
    layout.operator("karf.import_capture", icon="IMPORT")
    layout.operator("karf.find_poses", icon="CON_CAMERASOLVER")
    layout.operator("karf.import_splat", icon="OUTLINER_OB_POINTCLOUD")
    if not karf.project:
        return
    row = layout.row(align=True)
    row.operator("karf.look_through", text=karf.active_view, icon="VIEW_CAMERA", translate=False)
    row.prop(karf.looking, "hides_others", text="", icon="HIDE_ON" if karf.looking.hides_others else "HIDE_OFF")
    row.operator("karf.leave_view", text="", icon="LOOP_BACK")
    layout.label(text=count_of_photos(karf.views))
    draw_advice(layout, karf)
    row = layout.row(align=True)
    row.prop(karf, "project")
    row.operator("karf.open_folder", text="", icon="FILEBROWSER").folder = "project"
    if bpy.data.filepath and moving.is_hidden(context.scene):
        layout.operator("karf.move_project", icon="FILE_FOLDER")
    body = draw_advanced(layout, "import")
    if body is not None:
        draw_reprojection(body, context.scene)
        draw_space(body, karf, "photo_space")


def count_of_photos(views) -> str:
    """How many photos there are, and what for."""
    n_train = sum(view.split == "train" for view in views)
    if n_train == len(views):
        return f"{len(views)} photos, all to learn: new views are not judged"
    return f"{len(views)} photos: {n_train} to learn, {len(views) - n_train} to test"


def draw_advice(layout, karf):
    """What the engine says of the capture, and the way to ask it."""
    layout.operator("karf.check_capture", icon="VIEWZOOM")
    if queries.is_waiting("inspect"):
        layout.label(text="The engine is working", icon="SORTTIME")
        return
    sentence, *findings = karf.advice.splitlines() or [""]
    draw_text(layout, sentence, "ERROR" if karf.is_poor else "INFO")
    for finding in findings:
        draw_text(layout, finding, "DOT")


def draw_reprojection(layout, scene):
    """The sparse points, and how far they are from where the photo that is looked through shows them."""
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
    """Step 2."""
    if context.scene.karf.is_poor:
        draw_text(layout, context.scene.karf.advice.splitlines()[0], "ERROR")
    layout.prop(context.scene.karf, "preset")
    if context.scene.karf.project:
        draw_engine(layout)
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


def draw_engine(layout):
    """The way to an engine where there is none, or what is happening to it."""
    problem = state.known().problem
    if installing.is_running():
        progress = installing.progress()
        layout.progress(factor=progress.fraction, text=translate("Engine: {what}", what=progress.title))
    elif problem:
        draw_text(layout, problem, "INFO")
    if problem or installing.is_running():
        layout.operator("preferences.addon_show", text="KaRF Preferences", icon="PREFERENCES").module = extension


def draw_segment(layout, context):
    """Step 4."""
    layout.operator("karf.segment", icon="MOD_MASK")
    known = disk.contents_of(context.scene)
    if "segmentation" not in known.stages:
        return
    if not context.scene.karf.objects:  # then step 6 has them
        draw_masks(layout, context)
    body = draw_advanced(layout, "segment") if known.unsure else None
    if body is not None:
        draw_unsure(body, context, known)


def draw_unsure(layout, context, known):
    """How unsure the objects' borders are, which is no measure of how good the masks look, and where."""
    for name, share, is_unseen in known.unsure:
        shown = {"name": name, "share": f"{100 * share:.0f}"}
        if is_unseen:
            draw_text(
                layout, translate("{name}: {share} % unsure, not visible in any marked view", **shown), "QUESTION"
            )
        else:
            draw_text(layout, translate("{name}: {share} % unsure, marks and colors disagree", **shown), "QUESTION")
    if not context.scene.karf.objects:  # then step 6 has it
        layout.prop_enum(context.window_manager.karf_seeing, "mode", "UNSURE")
        draw_lacking(layout, context)


def draw_palette(layout, context):
    """Step 5."""
    layout.operator("karf.extract_palette", icon="COLOR")
