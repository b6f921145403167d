"""The steps from capture to picture as plain functions; scripts, buttons and tests call these.

    from bl_ext.user_default.karf.karf_blender import steps as karf

The first parameter of a step is the scene. A step that needs the engine for a while returns a `Task`: `wait` for it in a
script; an operator launches it (`tasks.runner.launch`). All other steps are done when they return. Colors are sRGB
triples in [0, 1] or "#rrggbb". Every step raises KarfError, with a sentence and a hint. See docs/blender.md for a script.
"""

from ..engine_api import Edit, KarfError
from ..rig.cameras import Options as RigOptions
from ..tasks.runner import Task
from .calibration import find_chart, pick_chart, remove_chart
from .cameras import export_cameras, frame_range, import_cameras
from .capture import SPLAT_VIEWS, find_poses, import_capture, import_splat
from .checking import check_capture, check_unasked
from .colorways import colorways, colorways_folder, predict_colorways
from .compositing import build_compositor, compositor_node, place_layers
from .edit import apply_edit, becomes, match_picture, paint_over, save_edit
from .engine import (
    engine_files,
    engine_status,
    examine_engine,
    install_engine,
    plan_engine,
    remove_engine,
    repair_engine,
)
from .farm import farm_bundle
from .learn import extract_palette, learn_all, learn_scene, learn_splats, prepare_views, segment, show_view
from .looks import (
    choose_look,
    flip_looks,
    keep_look,
    looks_folder,
    move_look,
    remove_look,
    rename_look,
    render_looks,
)
from .masks import (
    add_object,
    erase_mask,
    go_to_suggested,
    go_to_view,
    mark_box,
    mark_click,
    mark_lasso,
    mark_stroke,
    remove_object,
    set_volume,
    show_photo,
)
from .moving import move_project
from .preview import preview_camera
from .render import camera_folder, render_captured, render_sequence, render_view, save_shown
from .rendering import put_objects_in, use_engine
from .seeing import see_view, show_masks
from .sequences import add_strip, show_frames
from .splats import export_splat, follow_splat, unfollow_splat
from .surface import export_scene, place_points, show_scene
from .swatches import (
    Color,
    add_color,
    color_at,
    link_swatches,
    merge_swatch,
    protect_neutrals,
    remove_color,
    set_surface,
    set_swatch,
    split_swatch,
    unlink_swatch,
    use_color_name,
)
from .view import leave_view, look_through, reprojection_error
