"""Options of rendered views: files and formats."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from ..errors import BadRequest
from ..io.options import Options, option

# of recolored frames that do not have a photo's size, with their suffixes
FORMATS = {"png8": ".png", "png16": ".png", "exr16": ".exr", "exr32": ".exr"}

RECOLORED = "recolor/{view}"  # path of recolored pictures in the output folder

CONFIG = (
    "OpenColorIO configuration of named color spaces (default: that of the variable OCIO, else the one that comes with the "
    "package)"
)


@dataclass(frozen=True, kw_only=True)
class FrameOptions(Options):
    """What the files of each view contain."""

    base: str | None = option(
        "what an edit of a captured view changes (default: photo; with the preset paper: render)",
        None,
        choices=("photo", "render"),
    )
    size: str | int = option(
        "of masks and recolored pictures of captured views: photo (all its pixels), learned, or the long side in pixels",
        "photo",
    )
    jpeg: bool = option("write recolored JPEG photos as JPEG, not as PNG", False)
    alpha: bool = option("write renderings without what is behind the scene, with alpha", False)
    format: str = option("of recolored frames of new cameras; exr is scene-linear", "png8", choices=tuple(FORMATS))
    depth: bool = option("write depth/ too", False)
    unsure: bool = option("write unsure/ too: where objects' labels are unsure, white", False)
    layers: bool = option("write layers/ too (OpenEXR for compositors)", False)
    layered: bool = option(
        "with edit: write recolored pictures as layers to finish by hand too, <view>_layered.exr (OpenEXR: photo, "
        "recolored, mask and change of each object)",
        False,
    )
    layer_space: str | None = option(
        "color space of the layers' base picture, by its name in the OpenColorIO configuration, in 32 bits (default: "
        "linear Rec. 709, in 16)",
        None,
        metavar="NAME",
    )
    ocio: str | None = option(CONFIG, None, metavar="FILE")
    overrides: tuple[str, ...] = option(
        "change one setting (see the settings verb; of a learned project those of render), as render.edges=field; may "
        "be repeated",
        (),
        flag="set",
        metavar="STAGE.FIELD=VALUE",
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "size", parse_size(self.size))


@dataclass(frozen=True, kw_only=True)
class FrameFileOptions(FrameOptions):
    """Frames written to a folder."""

    edit: Path | tuple[Path, ...] | None = option(
        "EDIT.json, a palette file, or a folder with <view>.json for each view: write recolored frames too",
        None,
        metavar="FILE",
    )
    out: Path | None = option("folder for render/, masks/, recolor/", None, metavar="DIR")
    names: str = option(
        "path of recolored pictures in that folder, without suffix; {frame} is the number at the end of the view's name",
        RECOLORED,
        metavar="PATTERN",
    )
    planes: bool = option("write planes/ too (what Blender recolors from)", False)
    skip_existing: bool = option(
        "keep frames that are there already, made from the same: resumes where a job was stopped", False
    )


def parse_size(wanted: str | int) -> str | int:
    """Parse the size of recolored photos: `photo`, `learned`, or pixels. Raises BadRequest for others."""
    if wanted in ("photo", "learned"):
        return wanted
    if not str(wanted).isascii() or not str(wanted).isdigit() or int(wanted) < 1:
        raise BadRequest(f"{wanted!r:.200} is not a size.", "Use photo, learned, or the long side in pixels.")
    return int(wanted)
