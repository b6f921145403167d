"""Options of the learning stages."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from ...export.frame_options import CONFIG
from ...io.options import Options, option
from ...project.settings import PRESETS

MASKS = "coarse masks: DIR/<object>/<photo stem>.png"


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
    photo_space: str | None = option(
        "color space that the photos' files are in, by its name in the OpenColorIO configuration, as ACEScg; recolored "
        "photos are written in it (default: as the project was learned, else sRGB, of EXR linear Rec. 709)",
        None,
        metavar="NAME",
    )
    ocio: str | None = option(CONFIG, None, metavar="FILE")
    masks: Path | None = option("coarse masks, whose photos are learned from in any case", None, metavar="DIR")


@dataclass(frozen=True, kw_only=True)
class SegmentationOptions(Options):
    """Turn coarse masks into objects in all views."""

    command: ClassVar[str] = "segmentation"

    project: Path = option("project folder", positional=True, metavar="DIR")
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
class PaletteOptions(Options):
    """Extract a palette from the colors of every object."""

    command: ClassVar[str] = "palette"

    project: Path = option("project folder", positional=True, metavar="DIR")


@dataclass(frozen=True, kw_only=True)
class RecoloringOptions(Options):
    """Finish the palettes; with recoloring.iterations, train F_w, the palette weights of every point, and adapt them."""

    command: ClassVar[str] = "recoloring"

    project: Path = option("project folder", positional=True, metavar="DIR")
    overrides: tuple[str, ...] = option(
        "change one setting of F_w; may be repeated", (), flag="set", metavar="recoloring.FIELD=VALUE"
    )


@dataclass(frozen=True, kw_only=True)
class SplatsOptions(Options):
    """Learn the scene as Gaussians, which show it sharply from any camera."""

    command: ClassVar[str] = "splats"

    project: Path = option("project folder", positional=True, metavar="DIR")
    overrides: tuple[str, ...] = option(
        "change one setting of the splats; may be repeated", (), flag="set", metavar="splats.FIELD=VALUE"
    )


@dataclass(frozen=True, kw_only=True)
class LearnOptions(GeometryOptions):
    """Learn everything: geometry, segmentation, palette, recoloring, splats."""

    command: ClassVar[str] = "all"

    masks: Path = option(MASKS, metavar="DIR")
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
