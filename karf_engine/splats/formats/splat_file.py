"""The content of a file of Gaussians, and what all formats share: errors, checks and conversions."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ...capture.camera import LARGEST_POSITION
from ...errors import DataError, KarfError, Message, is_out_of_memory, missing_extra
from ..kernels.arrays import COLOR, LOG_SCALE, LOGIT, ROTATION
from ..similarity import mirror_table, transform_table

EXTRA = "splats"  # the extra of pyproject.toml
LOGITS = (-87.0, 16.0)  # beyond these the opacity rounds to 0 or 1 in float32
LOG_SCALES = (-87.0, 87.0)  # range of float32; smaller scales are flat Gaussians, larger ones are refused
LENGTHS = (1e-12, 1e12)  # of a quaternion; its square must not underflow or overflow
LARGEST_HARMONIC = 1e6
# PLY files usually have COLMAP's axes (x right, y down, z forward). Formats that define an up axis are written in
# OpenGL's (x right, y up, z backward), as nianticlabs/spz does: a half turn about x, its own inverse.
UPRIGHT = np.diag([1.0, -1.0, -1.0, 1.0])
SIDES = {"R": (1, 0, 0), "L": (-1, 0, 0), "D": (0, 1, 0), "U": (0, -1, 0), "F": (0, 0, 1), "B": (0, 0, -1)}  # in PLY


@dataclass(frozen=True)
class SplatFile:
    """n Gaussians in the axes and units of a PLY file of Kerbl et al. 2023."""

    table: np.ndarray  # [n, 11 + 3 K] float32, C-contiguous, finite; columns as in `gaussians.Gaussians.table`
    is_antialiased: bool | None = None  # trained with an opacity-compensated screen filter (Mip-Splatting)
    columns: Mapping[str, np.ndarray] = field(default_factory=dict)  # other values per Gaussian, [n]; PLY only
    n_skipped: int = 0  # rows of the file that are not Gaussians

    def __len__(self) -> int:
        return len(self.table)

    def remark(self, path: Path) -> Message | None:
        """Return a sentence about skipped rows, or None. path: the file."""
        if not self.n_skipped:
            return None
        return Message(
            "{path}: {skipped} of {count} rows are no Gaussians (values that are not finite, or rotations of zeros), and "
            "are left out.",
            path=path,
            skipped=self.n_skipped,
            count=self.n_skipped + len(self),
        )


def upright(table: np.ndarray) -> np.ndarray:
    """Rotate a table [n, 11 + 3 K] by 180 degrees about x, exactly."""
    return transform_table(table, UPRIGHT)


def from_axes(table: np.ndarray, axes: str) -> np.ndarray:
    """Return a table in the axes of PLY. axes: the sides that x, y and z point to, keys of `SIDES`, such as RUB."""
    matrix = np.eye(4)
    matrix[:3, :3] = np.array([SIDES[side] for side in axes]).T
    if np.linalg.det(matrix) < 0:  # left-handed
        table = mirror_table(table)
        matrix[:, 2] *= -1
    return transform_table(table, matrix)


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


def usable_rows(path: Path, table: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the rows of a table [n, 11 + 3 K] of any float type that are Gaussians, and which they are, [n] bool.

    The rows are as in `SplatFile`; infinite logits and log scales are clipped. Raises DataError if there are none.
    path: for messages.
    """
    if len(table) == 0:
        raise damaged(path, "it has no Gaussians")
    with np.errstate(over="ignore"):
        table = np.array(table, np.float32, order="C")
    lengths = np.linalg.norm(table[:, ROTATION:LOGIT].astype(np.float64), axis=1)
    checks = {  # NaN fails every comparison
        "a center that is not finite": (np.abs(table[:, :LOG_SCALE]) <= LARGEST_POSITION).all(1),
        "a scale that is not finite": (table[:, LOG_SCALE:ROTATION] <= LOG_SCALES[1]).all(1),
        "a rotation that is no quaternion": (lengths >= LENGTHS[0]) & (lengths <= LENGTHS[1]),
        "an opacity that is not a number": ~np.isnan(table[:, LOGIT]),
        "a color that is not finite": (np.abs(table[:, COLOR:]) <= LARGEST_HARMONIC).all(1),
    }
    is_usable = np.all([*checks.values()], axis=0)
    if not is_usable.any():
        raise DataError(
            "{path} cannot be read as Gaussians: none of its {count} rows is one; the first has {what}.",
            "Export it again in the program that wrote it.",
            path=path,
            count=len(table),
            what=next(what for what, is_good in checks.items() if not is_good[0]),
        )
    if not is_usable.all():
        table = table[is_usable]
    np.clip(table[:, LOG_SCALE:ROTATION], *LOG_SCALES, out=table[:, LOG_SCALE:ROTATION])
    np.clip(table[:, LOGIT], *LOGITS, out=table[:, LOGIT])
    return table, is_usable


def usable(path: Path, table: np.ndarray, is_antialiased: bool | None = None) -> SplatFile:
    """Return the content of a file without columns by `usable_rows`."""
    table, is_usable = usable_rows(path, table)
    return SplatFile(table, is_antialiased, n_skipped=int(np.sum(~is_usable)))


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
