"""The one door to the engine: its rooms that need nothing but the standard library and numpy."""

from pathlib import Path

from .. import karf_engine
from ..karf_engine.api import render_bundle
from ..karf_engine.capture import FORMATS, choose_views, hold_out, open_capture, write_cameras
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
from ..karf_engine.export.file_names import KINDS, file_paths, named, tokens_of
from ..karf_engine.export.finished_frames import FinishedFrames, frame_fingerprint
from ..karf_engine.export.layer_names import ObjectLayers, read_layer_names
from ..karf_engine.export.scene_points import ScenePoints, read_points, write_points
from ..karf_engine.io.color import ciede2000, lab_chroma, lab_hue, linear_to_srgb, srgb_to_lab, srgb_to_linear
from ..karf_engine.io.containment import checked_path
from ..karf_engine.io.files import atomic_write, check_file, checksum, read_json, write_json
from ..karf_engine.io.icc_matrix import MatrixSpace, matrix_space
from ..karf_engine.io.image_size import ImageHeader, find_header
from ..karf_engine.io.names import file_name, find_normalized, first_case_collision, is_file_name
from ..karf_engine.io.options import Options, bounds_of
from ..karf_engine.palettes.added import (
    extended_palettes,
    match_added_color,
    object_paints,
    propose_added_color,
    split_weights,
    split_weights_of_objects,
    wanted_color,
)
from ..karf_engine.palettes.calibration import ChartFit, ReferenceLight, fit_photo, to_mean_exposure, to_photo_exposure
from ..karf_engine.palettes.color_books import SUFFIXES as BOOK_SUFFIXES
from ..karf_engine.palettes.color_books import ColorBook, nearest_names, read_color_book
from ..karf_engine.palettes.color_histogram import ColorHistogram, read_object_colors, weighted_quantile
from ..karf_engine.palettes.color_text import color_to_text, colors_of_text
from ..karf_engine.palettes.colorways import PlannedColorway, plan_colorways
from ..karf_engine.palettes.compositing import Planes, planes_made_from, read_planes, stack_palettes
from ..karf_engine.palettes.edge_planes import ObjectEdge, apply_edges_to_planes
from ..karf_engine.palettes.edge_shape import MAX_CHOKE, MAX_FEATHER, Borders, EdgeShape
from ..karf_engine.palettes.matching.becomes import (
    add_fixed_paints,
    is_near,
    match_becomes,
    match_dragged,
    match_fewest,
    mean_weights,
    nearest_weights,
    residual_delta_e,
)
from ..karf_engine.palettes.matching.painted import ObjectMatch, match_picture
from ..karf_engine.palettes.matching.paints import pigment_gate
from ..karf_engine.palettes.matching.surface import MAX_BRIGHTNESS, MAX_FACTOR, Surface, match_surface
from ..karf_engine.palettes.palette import (
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

CAPTURE_MARKS = tuple(known.marker for known in FORMATS)  # a file or folder that each known kind of capture has
ENGINE_FOLDER = Path(karf_engine.__file__).parent  # what the engine's own Python executes
VERSION = karf_engine.__version__
