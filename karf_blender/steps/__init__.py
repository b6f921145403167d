"""The steps from capture to picture as plain functions; operators and scripts call these.

A step that needs the engine returns a `Task`: launch it beside the interface or wait for it (see `tasks.runner`). The
others are done when they return. All raise KarfError for what a user can mend.
"""

from .cameras import export_cameras, frame_range, import_cameras
from .capture import find_poses, import_capture
from .colorways import colorways_folder, predict_colorways, render_colorways
from .compositing import build_compositor, compositor_node, place_layers
from .edit import becomes, load_edit, match_picture, paint_over, save_edit
from .farm import camera_bundle
from .learn import extract_palette, learn_scene, prepare_views, segment, show_view
from .masks import paint_mask, save_mask
from .render import camera_folder, render_camera, render_captured, render_view, save_shown
from .sequences import add_strip, show_frames
from .swatches import link_swatches, merge_swatch, split_swatch, unlink_swatch
from .view import look_through, reprojection_error

__all__ = [
    "add_strip",
    "becomes",
    "build_compositor",
    "camera_bundle",
    "camera_folder",
    "colorways_folder",
    "compositor_node",
    "export_cameras",
    "extract_palette",
    "find_poses",
    "frame_range",
    "import_cameras",
    "import_capture",
    "learn_scene",
    "link_swatches",
    "load_edit",
    "look_through",
    "match_picture",
    "merge_swatch",
    "paint_mask",
    "paint_over",
    "place_layers",
    "predict_colorways",
    "prepare_views",
    "render_camera",
    "render_captured",
    "render_colorways",
    "render_view",
    "reprojection_error",
    "save_edit",
    "save_mask",
    "save_shown",
    "segment",
    "show_frames",
    "show_view",
    "split_swatch",
    "unlink_swatch",
]
