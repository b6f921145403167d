"""Every step for scripts: `blender --background --python script.py`, or a running Blender's console.

    from bl_ext.user_default.karf.karf_blender import headless as karf

Each function blocks until its work is done and raises KarfError (sentence and hint) where it fails. `scene` defaults to
the context's. Colors are sRGB triples in [0, 1] or "#rrggbb". See docs/blender.md for a whole script.
"""

from ..engine_api import Edit, KarfError
from .editing import (
    Color,
    add_color,
    apply_edit,
    becomes,
    link_swatches,
    match_picture,
    merge_swatch,
    prepare_views,
    remove_color,
    save,
    save_edit,
    set_swatch,
    show_view,
)
from .installing import engine_files, engine_status, install_engine, plan_engine, remove_engine, repair_engine
from .learning import extract_palette, find_poses, import_capture, learn_all, learn_scene, reprojection_error, segment
from .rendering import (
    add_strip,
    build_compositor,
    colorways,
    export_cameras,
    farm_bundle,
    import_cameras,
    preview_camera,
    render_captured,
    render_sequence,
    render_view,
    show_frames,
)
from .surface import export_scene, show_scene
from .testing import examine_engine

__all__ = [
    "Color",
    "Edit",
    "KarfError",
    "add_color",
    "add_strip",
    "apply_edit",
    "becomes",
    "build_compositor",
    "colorways",
    "engine_files",
    "engine_status",
    "examine_engine",
    "export_cameras",
    "export_scene",
    "extract_palette",
    "farm_bundle",
    "find_poses",
    "import_cameras",
    "import_capture",
    "install_engine",
    "learn_all",
    "learn_scene",
    "link_swatches",
    "match_picture",
    "merge_swatch",
    "plan_engine",
    "prepare_views",
    "preview_camera",
    "remove_color",
    "remove_engine",
    "render_captured",
    "render_sequence",
    "render_view",
    "repair_engine",
    "reprojection_error",
    "save",
    "save_edit",
    "segment",
    "set_swatch",
    "show_frames",
    "show_scene",
    "show_view",
]
