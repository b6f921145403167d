"""The content of a file of Gaussians, and what all formats share: errors, checks and conversions."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ...capture.camera import LARGEST_POSITION
from ...errors import DataError, KarfError, is_out_of_memory, missing_extra
from ..kernels.arrays import COLOR, LOG_SCALE, LOGIT, ROTATION
from ..similarity import transform_table

EXTRA = "splats"  # the extra of pyproject.toml
LOGITS = (-87.0, 16.0)  # beyond these the opacity rounds to 0 or 1 in float32
LOG_SCALES = (-87.0, 87.0)  # range of float32; smaller scales are flat Gaussians, larger ones are refused
LENGTHS = (1e-12, 1e12)  # of a quaternion; its square must not underflow or overflow
LARGEST_HARMONIC = 1e6
# PLY files usually have COLMAP's axes (x right, y down, z forward). Formats that define an up axis are written in
# OpenGL's (x right, y up, z backward), as nianticlabs/spz does: a half turn about x, its own inverse.
UPRIGHT = np.diag([1.0, -1.0, -1.0, 1.0])


@dataclass(frozen=True)
class SplatFile:
    """n Gaussians in the axes and units of a PLY file of Kerbl et al. 2023."""

    table: np.ndarray  # [n, 11 + 3 K] float32, C-contiguous, finite; columns as in `gaussians.Gaussians.table`
    is_antialiased: bool | None = None  # trained with an opacity-compensated screen filter (Mip-Splatting)
    columns: Mapping[str, np.ndarray] = field(default_factory=dict)  # other values per Gaussian, [n]; PLY only

    def __len__(self) -> int:
        return len(self.table)


def upright(table: np.ndarray) -> np.ndarray:
    """Rotate a table [n, 11 + 3 K] by 180 degrees about x, exactly."""
    return transform_table(table, UPRIGHT)


def damaged(path: Path, reason: str) -> DataError:
    """Return the error for a file that cannot be read."""
    return DataError(
        "{path} cannot be read as Gaussians: {reason}.", "Export or copy the file again.", path=path, reason=reason
    )


@contextmanager
def needing_packages() -> Iterator[None]:
    """Raise MissingDependency, which names the extra, where the block imports a package that is not installed."""
    try:
        yield
    except ImportError as error:
        if is_out_of_memory(error):
            raise
        raise missing_extra(error.name or "gsply", EXTRA) from error


@contextmanager
def explaining(path: Path) -> Iterator[None]:
    """Turn exceptions of a parser into DataError, and missing packages into MissingDependency."""
    try:
        with needing_packages():
            yield
    except Exception as error:  # packages raise anything
        if isinstance(error, KarfError | UnicodeEncodeError) or is_out_of_memory(error):
            raise
        words = f"it lacks {error.args[0]!r}" if isinstance(error, KeyError) else " ".join(str(error).split())
        raise damaged(path, words.rstrip(".") or type(error).__name__) from error


def checked(path: Path, table: np.ndarray) -> np.ndarray:
    """Return a table [n, 11 + 3 K] of any float type as in `SplatFile`; infinite logits and log scales are clipped.

    Raises DataError if the table is empty, or for the first row that is not a Gaussian. path: for messages.
    """
    if len(table) == 0:
        raise damaged(path, "it has no Gaussians")
    with np.errstate(over="ignore"):
        table = np.array(table, np.float32, order="C")
    centers, scales, rotations = table[:, :LOG_SCALE], table[:, LOG_SCALE:ROTATION], table[:, ROTATION:LOGIT]
    lengths = np.linalg.norm(rotations.astype(np.float64), axis=1)
    # NaN fails every comparison
    _refuse(path, "a center that is not finite", (np.abs(centers) <= LARGEST_POSITION).all(1))
    _refuse(path, "a scale that is not finite", (scales <= LOG_SCALES[1]).all(1))
    _refuse(path, "a rotation that is no quaternion", (lengths >= LENGTHS[0]) & (lengths <= LENGTHS[1]))
    _refuse(path, "an opacity that is not a number", ~np.isnan(table[:, LOGIT]))
    _refuse(path, "a color that is not finite", (np.abs(table[:, COLOR:]) <= LARGEST_HARMONIC).all(1))
    np.clip(scales, *LOG_SCALES, out=scales)
    np.clip(table[:, LOGIT], *LOGITS, out=table[:, LOGIT])
    return table


def _refuse(path: Path, what: str, is_good: Any) -> None:
    """Raise DataError for the first row of [n] bool that is false."""
    if not is_good.all():
        row = int(np.argmin(is_good))
        raise DataError(
            "{path} cannot be read as Gaussians: row {row} of {count}, counted from 0, has {what}.",
            "Remove such Gaussians in the program that wrote the file, and export it again.",
            path=path,
            row=row,
            count=len(is_good),
            what=what,
        )


def unit_rotations(table: np.ndarray) -> np.ndarray:
    """Return the unit quaternions w x y z of a table, [n, 4] float64."""
    rotations = table[:, ROTATION:LOGIT].astype(np.float64)
    return rotations / np.linalg.norm(rotations, axis=1, keepdims=True)


def logits(opacities: np.ndarray) -> np.ndarray:
    """Return float64 logits of opacities [...]: infinite at 0 and 1, NaN outside."""
    opacities = np.asarray(opacities, np.float64)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.log(opacities) - np.log1p(-opacities)


def opacities(logits: np.ndarray) -> np.ndarray:
    """Return float32 opacities in [0, 1] of logits [...]."""
    return (1 / (1 + np.exp(-np.asarray(logits, np.float64)))).astype(np.float32)


def log_scales(scales: np.ndarray) -> np.ndarray:
    """Return float64 logarithms of scales [...]: infinite at 0, NaN below."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.log(np.asarray(scales, np.float64))
