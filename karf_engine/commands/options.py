"""The registry of commands: the frozen dataclass of each one's options defines its parser, jobs and library function.

Imports only the standard library: Blender uses it too.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from ..errors import BadRequest
from ..export.frame_options import CONFIG, FrameFileOptions, FrameOptions, parse_size
from ..io.arguments import check_choice
from ..io.options import Options, option
from ..project.settings import PRESETS

MATCHING = ("auto", "exhaustive", "sequential")
UP = ("auto", "x", "y", "z", "-x", "-y", "-z")
FACES = ("front", "right", "back", "left", "up", "down")  # of a 360-degree photo, see `capture.panoramas`
WITHOUT_PHOTOS = ("cameras", "views", "size", "up")  # options of importing splats
RULES = ("becomes", "paint", "fewest")
Matrix4 = tuple[
    float, float, float, float, float, float, float, float, float, float, float, float, float, float, float, float
]
Corners = tuple[float, float, float, float, float, float, float, float]
Matrix3 = tuple[float, float, float, float, float, float, float, float, float]
QUALITIES = ("draft", "good", "best")
QUALITY = "of splats; draft: the whole scene alike; good, best: the marked objects from photos near their own size"
MASKS = "coarse masks: DIR/<object>/<photo stem>.png"


@dataclass(frozen=True, kw_only=True)
class ProjectOptions(Options):
    """Options of a command on a project."""

    project: Path = option("project folder", positional=True, metavar="DIR")


@dataclass(frozen=True, kw_only=True)
class PosesOptions(Options):
    """Make a capture of photos without camera poses, or of a video."""

    command: ClassVar[str] = "poses"

    photos: Path = option("folder of photos, or a video file", positional=True, metavar="PHOTOS")
    out: Path = option("the new capture's folder", metavar="DIR")
    matching: str = option(
        "which pairs of photos are compared: all, or neighbors by name (default: all of up to 250)",
        "auto",
        choices=MATCHING,
    )


@dataclass(frozen=True, kw_only=True)
class ImportSplatOptions(Options):
    """Make a capture of Gaussian splats that another program has learned, with its photos or without."""

    command: ClassVar[str] = "import-splat"

    splat: Path = option(
        "file of Gaussians: .ply, .compressed.ply, .spz, .splat, .sog, .glb, .gltf, .usd",
        positional=True,
        metavar="SPLAT",
    )
    out: Path = option("the new capture's folder", metavar="DIR")
    photos: Path | None = option(
        "capture that it was learned from, with the same poses (default: the Gaussians are rendered from cameras around "
        "them, or those of a cameras.json beside them)",
        None,
        metavar="CAPTURE",
    )
    cameras: Path | None = option("without photos: views of your own, as for render --cameras", None, metavar="FILE")
    views: int = option("without photos: how many cameras are chosen", 48, metavar="N", minimum=0, maximum=1000)
    size: int = option(
        "without photos: longest side of their pictures, pixels", 800, metavar="N", minimum=64, maximum=4096
    )
    up: str = option(
        "without photos: which axis points up (default: found by the largest flat parts)", "auto", choices=UP
    )
    antialiased: bool = option(
        "they were learned with antialiasing (Mip-Splatting) and the file does not say so; photos mostly tell by themselves",
        False,
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        changed = [name for name in WITHOUT_PHOTOS if getattr(self, name) != getattr(type(self), name)]
        if self.photos and changed:
            raise BadRequest(
                f"With photos, which are the views, the option {changed[0]!r} has no meaning.",
                "Leave out one of the two.",
            )


@dataclass(frozen=True, kw_only=True)
class PinholeOptions(Options):
    """Make a capture of ordinary photos of one with 360-degree photos: the faces of the cube around each."""

    command: ClassVar[str] = "pinhole"

    capture: Path = option("capture with equirectangular photos and camera poses", positional=True, metavar="CAPTURE")
    out: Path = option("the new capture's folder", metavar="DIR")
    faces: str = option("which faces, separated by commas", ",".join(FACES), metavar="NAMES")
    size: int | None = option(
        "side of a face, pixels (default: a quarter of the photo's width)", None, metavar="N", minimum=16, maximum=16384
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in self.face_names():
            check_choice("faces", name, FACES)

    def face_names(self) -> tuple[str, ...]:
        """Return the faces, each once."""
        return tuple(dict.fromkeys(name.strip() for name in self.faces.split(",")))


@dataclass(frozen=True, kw_only=True)
class InspectOptions(Options):
    """Say how good a capture is before it is learned, and where more photos would help."""

    command: ClassVar[str] = "inspect"

    capture: Path = option("folder or transforms.json with photos and camera poses", positional=True, metavar="CAPTURE")
    masks: Path | None = option("folder of rough masks, whose thin parts are told of", None, metavar="DIR")
    holdout: int = option("leave out every Nth photo, as for geometry", 0, metavar="N")
    without: tuple[str, ...] = option(
        "leave out these photos, by the names of their views, as for geometry; may be repeated", (), metavar="VIEW"
    )
    out: Path | None = option("folder for inspection.json and more_photos.png", None, metavar="DIR")


@dataclass(frozen=True, kw_only=True)
class MarkOptions(Options):
    """Write the mask of an object in one photo, from a box, clicks or a lasso."""

    command: ClassVar[str] = "mark"

    capture: Path = option("folder or transforms.json with photos and camera poses", positional=True, metavar="CAPTURE")
    view: str = option("which photo", metavar="NAME")
    object_name: str = option("what the object is called", flag="object", metavar="NAME")
    masks: Path = option("write MASKS/<object>/<view>.png", flag="out", metavar="MASKS")
    box: tuple[float, float, float, float] | None = option(
        "a frame that the object lies in, pixels of the photo as stored", None, metavar="X0,Y0,X1,Y1"
    )
    points: tuple[tuple[float, float, bool], ...] = option(
        "pixels X,Y that show the object (--click) or do not (--not), in the order of the clicks; may be repeated",
        (),
        flag=None,
    )
    lasso: tuple[tuple[float, float], ...] | None = option("corners X,Y of a line around the object", None, flag=None)
    weights: Path | None = option("a Segment Anything model's folder; needs the extra marks", None, metavar="DIR")


@dataclass(frozen=True, kw_only=True)
class GeometryOptions(Options):
    """Learn the scene from photos with poses. Marked photos are among those that it learns from."""

    command: ClassVar[str] = "geometry"

    capture: Path = option("folder or transforms.json with photos and camera poses", positional=True, metavar="CAPTURE")
    project: Path = option("project folder, made if needed", metavar="DIR")
    preset: str = option("quality against time", "demo", choices=tuple(PRESETS))
    overrides: tuple[str, ...] = option(
        "change one setting (see the settings verb); may be repeated", (), flag="set", metavar="STAGE.FIELD=VALUE"
    )
    nerf: Path | None = option(
        "import a NeRF that another program has trained on this capture: nerf-pytorch .tar, krrish94 .ckpt",
        None,
        metavar="FILE",
    )
    holdout: int | None = option(
        "hold out every Nth photo, unless it is marked, to test what is learned, where the capture declares no test "
        "photos; 0: none (default: as the project was learned, else none)",
        None,
        metavar="N",
    )
    without: tuple[str, ...] | None = option(
        "learn without these photos, by the names of their views, unless they are marked; may be repeated, '' for none "
        "(default: as the project was learned)",
        None,
        metavar="VIEW",
    )
    photo_space: str | None = option(
        "color space that the photos' files are in, by its name in the OpenColorIO configuration, as ACEScg; recolored "
        "photos are written in it (default: as the project was learned, else sRGB, of EXR linear Rec. 709)",
        None,
        metavar="NAME",
    )
    ocio: str | None = option(CONFIG, None, metavar="FILE")
    masks: Path | None = option("coarse masks, whose photos are learned from in any case", None, metavar="DIR")


@dataclass(frozen=True, kw_only=True)
class SegmentationOptions(ProjectOptions):
    """Turn coarse masks into objects in all views."""

    command: ClassVar[str] = "segmentation"

    masks: Path | None = option(f"{MASKS} (default: the project's own)", None, metavar="DIR")
    volumes: Path | None = option(
        "boxes and meshes that objects must be inside or outside of (default: the project's own volumes.json)",
        None,
        metavar="FILE",
    )
    corrections: Path | None = option(
        "partial marks: DIR/<object>/<view>.png, gray with alpha (default: the project's own)", None, metavar="DIR"
    )


@dataclass(frozen=True, kw_only=True)
class PaletteOptions(ProjectOptions):
    """Extract a palette from the colors of every object."""

    command: ClassVar[str] = "palette"


@dataclass(frozen=True, kw_only=True)
class RecoloringOptions(ProjectOptions):
    """Finish the palettes; with recoloring.iterations, train F_w, the palette weights of every point, and adapt them."""

    command: ClassVar[str] = "recoloring"

    overrides: tuple[str, ...] = option(
        "change one setting of F_w; may be repeated", (), flag="set", metavar="recoloring.FIELD=VALUE"
    )


@dataclass(frozen=True, kw_only=True)
class SplatsOptions(ProjectOptions):
    """Learn the scene as Gaussians, which show it sharply from any camera."""

    command: ClassVar[str] = "splats"

    quality: str = option(QUALITY, "draft", choices=QUALITIES)
    overrides: tuple[str, ...] = option(
        "change one setting of the splats; may be repeated", (), flag="set", metavar="splats.FIELD=VALUE"
    )


@dataclass(frozen=True, kw_only=True)
class EraseOptions(ProjectOptions):
    """Leave out splats whose centers are in a box, as floaters, or bring them back."""

    command: ClassVar[str] = "erase"

    boxes: tuple[Matrix4, ...] = option(
        "16 numbers, row by row: from the cube -1 to 1 to the capture's world; may be repeated",
        (),
        flag="box",
        metavar="M00,M01,...",
    )
    restore: bool = option("bring back all that was erased", False)

    def __post_init__(self) -> None:
        super().__post_init__()
        if bool(self.boxes) == self.restore:
            given = "both boxes and restore" if self.restore else "no box"
            raise BadRequest(f"The erase command was given {given}.", "Give boxes, or restore.")


@dataclass(frozen=True, kw_only=True)
class LearnOptions(GeometryOptions):
    """Learn everything: geometry, segmentation, palette, recoloring, splats."""

    command: ClassVar[str] = "all"

    masks: Path = option(MASKS, metavar="DIR")
    quality: str = option(QUALITY, "draft", choices=QUALITIES)
    corrections: Path | None = option(
        "partial marks, as for segmentation (default: the project's own)", None, metavar="DIR"
    )
    volumes: Path | None = option(
        "boxes and meshes, as for segmentation (default: the project's own)", None, metavar="FILE"
    )

    def stages(self) -> tuple[Options, ...]:
        """Return the options of each stage, in order."""
        kinds = (GeometryOptions, SegmentationOptions, PaletteOptions, RecoloringOptions, SplatsOptions)
        return tuple(self.subset(kind) for kind in kinds)


@dataclass(frozen=True, kw_only=True)
class CalibrationOptions(Options):
    """The light of target colors: that of the photos, or daylight."""

    card: str | None = option(
        "what a gray card of L* 50 looks like in the photos, #rrggbb: target colors are then those under daylight (D65), "
        "as books of colors give them",
        None,
        metavar="COLOR",
    )
    chart: Path | None = option(
        "the same by a photo with a color chart of 24 patches (ColorChecker Classic), as exposed and lit as the photos",
        None,
        metavar="PHOTO",
    )
    corners: Corners | None = option(
        "with chart: u,v of the four corners of its block of patches, in pixels of the photo, round it (default: it is "
        "looked for)",
        None,
        metavar="U,V,...",
    )
    light: Matrix3 | None = option(
        "in their place: the matrix, row by row, from linear light under daylight to that in the photos",
        None,
        flag=None,
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if sum(each is not None for each in (self.card, self.chart, self.light)) > 1:
            raise BadRequest("A gray card and a color chart were given.", "Give one of them: the chart says more.")
        if self.corners is not None and self.chart is None:
            raise BadRequest("The corners of a color chart were given, but no photo of it.", "Give --chart PHOTO.")


@dataclass(frozen=True, kw_only=True)
class MatchOptions(CalibrationOptions, ProjectOptions):
    """Write the edit that turns one color of an object into another, or a view into a painted version of it."""

    command: ClassVar[str] = "match"

    object: str | None = option("which object", None)
    source: str | None = option("a color it shows, #rrggbb", None, flag="from", metavar="COLOR")
    target: str | None = option("the color it shall become, #rrggbb", None, flag="to", metavar="COLOR")
    also: tuple[tuple[str, str], ...] = option(
        "another paint of the object and what it becomes; all pairs are solved together (may be repeated)",
        (),
        metavar=("FROM", "TO"),
    )
    rule: str = option(
        "becomes: the whole object; paint: this paint alone, other paints and neutrals stay; fewest: as few swatches as "
        "possible",
        "becomes",
        choices=RULES,
    )
    is_metal: bool = option("with becomes: highlights take the paint's color, and not the light's", False, flag="metal")
    view: str | None = option("in place of a color pair: the view that --picture shows", None)
    picture: Path | None = option("this view painted over or graded, of any size", None, metavar="FILE")
    edit: Path | None = option(
        "start from this edit (one call an object); with --picture the one that was painted on", None, metavar="FILE"
    )
    out: Path = option("EDIT.json to write", metavar="FILE")

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("view", "picture") if self.is_of_picture else ("object", "source", "target"):
            if not getattr(self, name):
                raise BadRequest(
                    f"The match was given no {name}.",
                    "Give object, source color, target color and out; or view, picture and out.",
                )

    @property
    def is_of_picture(self) -> bool:
        """True to match a painted picture instead of color pairs."""
        return bool(self.view or self.picture)


@dataclass(frozen=True, kw_only=True)
class RenderOptions(FrameFileOptions, ProjectOptions):
    """Render masks, pictures and recolored frames, of captured views or of any cameras."""

    command: ClassVar[str] = "render"

    views: str = option(
        "train, test, val, all, names and ranges with commas (0000-0007), or CAMERAS.json (transforms.json with sizes)",
        "all",
    )
    first: int | None = option("the first of these views to write, counted from 1", None, metavar="N")
    last: int | None = option("the last one; beyond the end: the end", None, metavar="N")
    count: int | None = option("how many at most", None, metavar="N")


@dataclass(frozen=True, kw_only=True)
class ColorwaysOptions(CalibrationOptions, ProjectOptions):
    """Render every colorway of a sheet in every view."""

    command: ClassVar[str] = "colorways"

    sheet: Path = option("CSV or JSON: colorway, object, and a color as hex, lab, srgb or srgb8", metavar="FILE")
    views: str = option("as for render", "all")
    out: Path = option(
        "folder for <colorway>/, colorways.csv and the contact sheet; pictures that are there already are not made "
        "again",
        metavar="DIR",
    )
    names: str = option("path of pictures in that folder, without suffix", "{look}/{view}", metavar="PATTERN")
    size: str | int = option("as for render", "photo")
    predict_only: bool = option("only write colorways.csv: what will be reached", False)
    locked: tuple[str, ...] = option("swatches that stay as learned, each as <object>/<number>", (), flag=None)
    edges: Path | None = option(
        "EDIT.json whose objects' choke and feather every colorway of colors has", None, metavar="FILE"
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "size", parse_size(self.size))


@dataclass(frozen=True, kw_only=True)
class PointsOptions(ProjectOptions):
    """Write the scene as points on its surface."""

    command: ClassVar[str] = "points"

    out: Path = option(".ply: colored points; .npz: with what recoloring them needs", metavar="FILE")
    count: int = option("about how many points", 60_000, metavar="N")
    edit: Path | None = option("EDIT.json or a palette file: a .ply gets these colors", None, metavar="FILE")


@dataclass(frozen=True, kw_only=True)
class ExportSplatOptions(ProjectOptions):
    """Write the scene as Gaussian splats for other programs, with an edit baked in."""

    command: ClassVar[str] = "export-splat"

    out: Path = option("the file: .ply, .compressed.ply, .spz, .sog, .glb, .gltf, .usd, .usda or .usdc", metavar="FILE")
    edit: Path | None = option("EDIT.json or a palette file whose colors it gets", None, metavar="FILE")
    sheet: Path | None = option(
        "in place of an edit, a sheet as for colorways: a file for each, named FILE_<colorway>", None, metavar="FILE"
    )
    objects: tuple[str, ...] = option(
        "only the Gaussians of this object, cut out; may be repeated", (), flag="object", metavar="NAME"
    )
    solid: bool = option("leave out the shell that shows what is behind the scene", False)
    attributes: bool = option("add to each Gaussian its object, probability and palette weights; .ply only", False)
    spz_version: int = option(
        "of a .spz: 3, which every reader knows, or 4, which declares its axes", 3, metavar="N", minimum=3, maximum=4
    )
    matrix: Matrix4 | None = option(
        "16 numbers, row by row: a rotation, uniform scale and translation from the capture's world to the file's",
        None,
        metavar="M00,M01,...",
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.edit and self.sheet:
            raise BadRequest("The export was given both an edit and a sheet.", "Give one of them.")


@dataclass(frozen=True, kw_only=True)
class ExportPageOptions(ProjectOptions):
    """Write a web page that shows the scene in its looks, for a client's browser."""

    command: ClassVar[str] = "export-page"

    out: Path = option("the page's folder: new, empty, or with an earlier page, which is replaced", metavar="DIR")
    looks: tuple[Path, ...] = option(
        "EDIT.json or a palette file, a look of the file's name; may be repeated", (), flag="look", metavar="EDIT"
    )
    sheet: Path | None = option("a sheet as for colorways: a look for each of its colorways", None, metavar="FILE")
    single: bool = option("put all into index.html, which opens by a double click", False)
    title: str = option("heading of the page (default: the project's folder)", "", metavar="TEXT")
    studio: str = option("who made it", "", metavar="TEXT")
    logo: Path | None = option("picture beside the heading: .png, .jpg, .webp or .svg", None, metavar="FILE")
    locked: tuple[str, ...] = option(
        "a swatch that the page does not offer, as <object>/<number>; may be repeated", (), metavar="SWATCH"
    )
    overrides: tuple[str, ...] = option(
        "change one setting, as render.unseen=shown, which fades nothing; may be repeated",
        (),
        flag="set",
        metavar="render.FIELD=VALUE",
    )
    reduce: int | None = option(
        "how many Gaussians at most, the least visible are left out", None, metavar="N", minimum=1000, maximum=500_000
    )


@dataclass(frozen=True, kw_only=True)
class FarmOptions(FrameOptions):
    """Write a job for a render farm: a folder by the Open Job Description specification."""

    command: ClassVar[str] = "farm"

    source: Path = option(
        "project folder; with --masks, a capture that is learned first", positional=True, metavar="SOURCE"
    )
    out: Path = option("the bundle's folder, new or empty", metavar="DIR")
    masks: Path | None = option("learn SOURCE first, with these coarse masks", None, metavar="DIR")
    preset: str | None = option("with --masks: quality against time (default: demo)", None, choices=tuple(PRESETS))
    holdout: int = option("with --masks: hold out every Nth photo, as for geometry", 0, metavar="N")
    views: str = option("as for render", "all")
    edit: Path | tuple[Path, ...] | None = option("as for render: recolored frames too", None, metavar="FILE")
    photos: Path | None = option(
        "a folder outside of capture and project whose photos may be packed", None, metavar="DIR"
    )
    per_task: int = option("frames a task", 10, metavar="N", minimum=1)
    python: str = option("of the farm's machines, with the engine's packages", "python3")


# by name, in the order of the workflow
COMMANDS: dict[str, type[Options]] = {
    kind.command: kind
    for kind in (
        PosesOptions,
        ImportSplatOptions,
        PinholeOptions,
        InspectOptions,
        MarkOptions,
        LearnOptions,
        GeometryOptions,
        SegmentationOptions,
        PaletteOptions,
        RecoloringOptions,
        SplatsOptions,
        EraseOptions,
        MatchOptions,
        RenderOptions,
        ColorwaysOptions,
        PointsOptions,
        ExportSplatOptions,
        ExportPageOptions,
        FarmOptions,
    )
}


def options_of_job(command: str, project: Path, values: Mapping[str, Any]) -> Options:
    """Return the options of a job's request, made of JSON values; some commands ignore the project.

    Raises BadRequest if an option is unknown, missing, of another type or out of range.
    """
    if command not in COMMANDS:
        raise BadRequest(f"Unknown command {command!r:.200}.", f"Use one of: {', '.join(COMMANDS)}.")
    kind = COMMANDS[command]
    own = {"project": project} if "project" in kind.__dataclass_fields__ else {}
    return kind.from_json({**values, **own})
