"""Options of the commands before learning: camera poses, imports and marks."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from ...errors import BadRequest
from ...io.options import Options, option

MATCHING = ("auto", "exhaustive", "sequential")
UP = ("auto", "x", "y", "z", "-x", "-y", "-z")
WITHOUT_PHOTOS = ("cameras", "views", "size", "up")  # options of importing splats


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
class InspectOptions(Options):
    """Say how good a capture is before it is learned, and where more photos would help."""

    command: ClassVar[str] = "inspect"

    capture: Path = option("folder or transforms.json with photos and camera poses", positional=True, metavar="CAPTURE")
    masks: Path | None = option("folder of rough masks, whose thin parts are told of", None, metavar="DIR")
    holdout: int = option("leave out every Nth photo, as for geometry", 0, metavar="N")
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
