"""The steps from capture to picture as plain functions of a scene, for scripts, buttons and tests; see docs/blender.md.

A step that needs the engine for a while returns a `Task`: `wait` for it in a script; an operator launches it. Colors
are sRGB triples in [0, 1] or "#rrggbb". Every step raises KarfError, with a sentence and a hint.
"""

from ..engine_api import Edit, KarfError
from ..rig.cameras import Options as RigOptions
from ..swatches.colors import forget_chart as remove_chart
from ..swatches.looks import choose as choose_look
from ..swatches.looks import rename as rename_look
from ..tasks.runner import Task
from .capture import (
    SPLAT_VIEWS,
    check_capture,
    check_unasked,
    find_poses,
    import_capture,
    import_splat,
    leave_out_blurred,
    move_project,
)
from .engine import (
    engine_files,
    engine_status,
    examine_engine,
    install_engine,
    plan_engine,
    remove_engine,
    repair_engine,
)
from .floaters import add_delete_box, delete_inside, restore_splats
from .learn import extract_palette, learn_all, learn_scene, learn_splats, segment
from .looks import (
    colorways,
    colorways_folder,
    export_page,
    flip_looks,
    keep_look,
    looks_folder,
    move_look,
    page_folder,
    predict_colorways,
    remove_look,
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
from .preview import preview_camera
from .render import (
    STANDARD,
    add_strip,
    camera_folder,
    export_cameras,
    farm_bundle,
    frame_range,
    import_cameras,
    put_objects_in,
    render_captured,
    render_sequence,
    render_view,
    save_shown,
    show_frames,
    use_engine,
    use_standard,
)
from .scene_nodes import build_compositor, export_scene, place_layers, place_points, show_scene
from .splats import export_splat, follow_splat, unfollow_splat
from .swatches import (
    Color,
    add_color,
    apply_edit,
    becomes,
    color_at,
    find_chart,
    link_swatches,
    match_picture,
    merge_swatch,
    paint_over,
    pick_chart,
    remove_color,
    save_edit,
    set_surface,
    set_swatch,
    split_swatch,
    unlink_swatch,
    use_color_name,
)
from .views import leave_view, look_through, prepare_views, reprojection_error, see_view, show_masks, show_view
