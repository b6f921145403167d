"""The one door to the engine: its rooms that need nothing but the standard library and numpy."""

from pathlib import Path

from .. import karf_engine
from ..karf_engine.api import render_bundle
from ..karf_engine.capture import FORMATS, hold_out, open_capture, write_cameras
from ..karf_engine.capture.camera import Camera, wrong_size_error
from ..karf_engine.capture.capture import UNIT_GAINS, Capture, SparsePoints, View, masks_of_view
from ..karf_engine.capture.distortion import distort, undistort_points_near, undistorted
from ..karf_engine.capture.sparse_points import ErrorSummary, observed_points, reprojection_errors, summarize
from ..karf_engine.capture.transforms import camera_to_json
from ..karf_engine.commands.options import FarmOptions, PointsOptions
from ..karf_engine.errors import (
    BadRequest,
    Cancelled,
    DataError,
    KarfError,
    Message,
    MissingDependency,
    error_from_code,
)
from ..karf_engine.export.layer_names import ObjectLayers, read_layer_names
from ..karf_engine.export.scene_points import ScenePoints, read_points, write_points
from ..karf_engine.io.color import ciede2000, lab_chroma, lab_hue, linear_to_srgb, srgb_to_lab, srgb_to_linear
from ..karf_engine.io.containment import checked_path
from ..karf_engine.io.files import atomic_write, check_file, checksum, read_json, write_json
from ..karf_engine.io.image_size import find_header
from ..karf_engine.io.names import file_name, find_normalized, first_case_collision, is_file_name
from ..karf_engine.io.options import Options, bounds_of
from ..karf_engine.palettes.added import (
    extended_palettes,
    match_added_color,
    pigment_of_swatch,
    propose_added_color,
    split_weights,
    split_weights_of_objects,
)
from ..karf_engine.palettes.calibration import ChartFit, ReferenceLight, fit_photo, to_mean_exposure, to_photo_exposure
from ..karf_engine.palettes.color_books import SUFFIXES as BOOK_SUFFIXES
from ..karf_engine.palettes.color_books import ColorBook, nearest_names, read_color_book
from ..karf_engine.palettes.color_histogram import ColorHistogram, read_object_colors
from ..karf_engine.palettes.color_text import color_to_text, colors_of_text
from ..karf_engine.palettes.colorways import PlannedColorway, plan_colorways
from ..karf_engine.palettes.compositing import Planes, planes_made_from, read_planes, stack_palettes
from ..karf_engine.palettes.edge_planes import ObjectEdge, apply_edges_to_planes
from ..karf_engine.palettes.edge_shape import MAX_CHOKE, MAX_FEATHER, Borders, EdgeShape
from ..karf_engine.palettes.matching.becomes import (
    add_fixed_paints,
    match_becomes,
    match_dragged,
    match_fewest,
    mean_weights,
    nearest_weights,
    residual_delta_e,
)
from ..karf_engine.palettes.matching.painted import ObjectMatch, match_picture
from ..karf_engine.palettes.matching.surface import MAX_BRIGHTNESS, MAX_FACTOR, Surface, match_surface
from ..karf_engine.palettes.palette import (
    COMPOSITING_MODES,
    MAX_ADDED,
    MAX_PROTECT,
    MAX_REACH,
    MAX_SRGB,
    PROTECT,
    REACH,
    AddedColor,
    Edit,
    Palette,
    edit_from_json,
    edit_to_json,
    hex_to_rgb,
    read_palettes,
    rgb_to_hex,
    write_edit,
)
from ..karf_engine.palettes.palette_files import SUFFIXES as EDIT_SUFFIXES
from ..karf_engine.palettes.palette_files import read_edit_file, write_edit_file
from ..karf_engine.palettes.prediction import dominant_color, evaluate_edit, reached_color
from ..karf_engine.palettes.prediction import edited_colors as shown_colors
from ..karf_engine.palettes.swatch_picture import ObjectPlanes, SwatchPicture, delta_picture, paper_picture
from ..karf_engine.project import Project
from ..karf_engine.project.jobs import new_job
from ..karf_engine.project.settings import PRESETS, seconds_of_stages
from ..karf_engine.project.state import result_fingerprint
from ..karf_engine.project.volumes import Volume, read_volumes, write_volumes
from ..karf_engine.worker.findings import ERROR, OK, REQUIRED, VERDICT, WARNING, Finding
from ..karf_engine.worker.protocol import (
    CANCEL,
    LOG_FILE,
    REQUEST_FILE,
    WARM,
    Event,
    EventReader,
    Query,
    Request,
    folder_line,
)

# the file or folder by which each known kind of capture is recognized
CAPTURE_MARKS = tuple(known.marker for known in FORMATS)
# the folder that the engine's own Python executes
ENGINE_FOLDER = Path(karf_engine.__file__).parent
VERSION = karf_engine.__version__

__all__ = [
    "BOOK_SUFFIXES",
    "CANCEL",
    "CAPTURE_MARKS",
    "COMPOSITING_MODES",
    "EDIT_SUFFIXES",
    "ENGINE_FOLDER",
    "ERROR",
    "LOG_FILE",
    "MAX_ADDED",
    "MAX_BRIGHTNESS",
    "MAX_CHOKE",
    "MAX_FACTOR",
    "MAX_FEATHER",
    "MAX_PROTECT",
    "MAX_REACH",
    "MAX_SRGB",
    "OK",
    "PRESETS",
    "PROTECT",
    "REACH",
    "REQUEST_FILE",
    "REQUIRED",
    "UNIT_GAINS",
    "VERDICT",
    "VERSION",
    "WARM",
    "WARNING",
    "AddedColor",
    "BadRequest",
    "Borders",
    "Camera",
    "Cancelled",
    "Capture",
    "ChartFit",
    "ColorBook",
    "ColorHistogram",
    "DataError",
    "EdgeShape",
    "Edit",
    "ErrorSummary",
    "Event",
    "EventReader",
    "FarmOptions",
    "Finding",
    "KarfError",
    "Message",
    "MissingDependency",
    "ObjectEdge",
    "ObjectLayers",
    "ObjectMatch",
    "ObjectPlanes",
    "Options",
    "Palette",
    "Planes",
    "PlannedColorway",
    "PointsOptions",
    "Project",
    "Query",
    "ReferenceLight",
    "Request",
    "ScenePoints",
    "SparsePoints",
    "Surface",
    "SwatchPicture",
    "View",
    "Volume",
    "add_fixed_paints",
    "apply_edges_to_planes",
    "atomic_write",
    "bounds_of",
    "camera_to_json",
    "check_file",
    "checked_path",
    "checksum",
    "ciede2000",
    "color_to_text",
    "colors_of_text",
    "delta_picture",
    "distort",
    "dominant_color",
    "edit_from_json",
    "edit_to_json",
    "error_from_code",
    "evaluate_edit",
    "extended_palettes",
    "file_name",
    "find_header",
    "find_normalized",
    "first_case_collision",
    "fit_photo",
    "folder_line",
    "hex_to_rgb",
    "hold_out",
    "is_file_name",
    "lab_chroma",
    "lab_hue",
    "linear_to_srgb",
    "masks_of_view",
    "match_added_color",
    "match_becomes",
    "match_dragged",
    "match_fewest",
    "match_picture",
    "match_surface",
    "mean_weights",
    "nearest_names",
    "nearest_weights",
    "new_job",
    "observed_points",
    "open_capture",
    "paper_picture",
    "pigment_of_swatch",
    "plan_colorways",
    "planes_made_from",
    "propose_added_color",
    "reached_color",
    "read_color_book",
    "read_edit_file",
    "read_json",
    "read_layer_names",
    "read_object_colors",
    "read_palettes",
    "read_planes",
    "read_points",
    "read_volumes",
    "render_bundle",
    "reprojection_errors",
    "residual_delta_e",
    "result_fingerprint",
    "rgb_to_hex",
    "seconds_of_stages",
    "shown_colors",
    "split_weights",
    "split_weights_of_objects",
    "srgb_to_lab",
    "srgb_to_linear",
    "stack_palettes",
    "summarize",
    "to_mean_exposure",
    "to_photo_exposure",
    "undistort_points_near",
    "undistorted",
    "write_cameras",
    "write_edit",
    "write_edit_file",
    "write_json",
    "write_points",
    "write_volumes",
    "wrong_size_error",
]
