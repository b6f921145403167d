"""The steps from capture to picture as plain functions; operators and scripts call these.

A step that needs the engine returns a `Task`: launch it alongside the interface or wait for it (see `tasks.runner`). The
others are done when they return. All raise KarfError for what a user can mend.
"""

from .calibration import find_chart, pick_chart, remove_chart
from .cameras import export_cameras, frame_range, import_cameras
from .capture import SPLAT_VIEWS, find_poses, import_capture, import_splat
from .checking import check_capture, check_unasked
from .colorways import colorways, colorways_folder, predict_colorways
from .compositing import build_compositor, compositor_node, place_layers
from .edit import apply_edit, becomes, match_picture, paint_over, save_edit
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
from .surface import export_scene, place_points, show_colors, show_scene
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

__all__ = [
    "SPLAT_VIEWS",
    "Color",
    "add_color",
    "add_object",
    "add_strip",
    "apply_edit",
    "becomes",
    "build_compositor",
    "camera_folder",
    "check_capture",
    "check_unasked",
    "choose_look",
    "color_at",
    "colorways",
    "colorways_folder",
    "compositor_node",
    "erase_mask",
    "export_cameras",
    "export_scene",
    "export_splat",
    "extract_palette",
    "farm_bundle",
    "find_chart",
    "find_poses",
    "flip_looks",
    "follow_splat",
    "frame_range",
    "go_to_suggested",
    "go_to_view",
    "import_cameras",
    "import_capture",
    "import_splat",
    "keep_look",
    "learn_all",
    "learn_scene",
    "learn_splats",
    "leave_view",
    "link_swatches",
    "look_through",
    "looks_folder",
    "mark_box",
    "mark_click",
    "mark_lasso",
    "mark_stroke",
    "match_picture",
    "merge_swatch",
    "move_look",
    "move_project",
    "paint_over",
    "pick_chart",
    "place_layers",
    "place_points",
    "predict_colorways",
    "prepare_views",
    "preview_camera",
    "protect_neutrals",
    "put_objects_in",
    "remove_chart",
    "remove_color",
    "remove_look",
    "remove_object",
    "rename_look",
    "render_captured",
    "render_looks",
    "render_sequence",
    "render_view",
    "reprojection_error",
    "save_edit",
    "save_shown",
    "see_view",
    "segment",
    "set_surface",
    "set_swatch",
    "set_volume",
    "show_colors",
    "show_frames",
    "show_masks",
    "show_photo",
    "show_scene",
    "show_view",
    "split_swatch",
    "unfollow_splat",
    "unlink_swatch",
    "use_color_name",
    "use_engine",
]
