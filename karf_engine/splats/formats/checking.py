"""What the readers of all kinds share: tables whose every row can be a Gaussian, and how faults are told."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from ...capture.limits import LARGEST_POSITION
from ...errors import DataError, KarfError, is_out_of_memory, missing_extra
from ...io.inputs import MOST_BYTES
from ..kernels.arrays import COLOR, LOG_SCALE, LOGIT, ROTATION

EXTRA = "splats"  # of pyproject.toml: the packages of the kinds that need one
LOGITS = (-87.0, 16.0)  # beyond them float32 cannot tell the opacity from 0 and 1
LOG_SCALES = (-87.0, 87.0)  # beyond them float32 cannot hold the scale; a smaller one is flat, a larger one damage
LENGTHS = (1e-12, 1e12)  # of a quaternion: beyond them its square is 0 or infinite
LARGEST_HARMONIC = 1e6
# bytes of a table for one of its file: about one Gaussian without further harmonics. Real packing of any degree stays
# below 30; a small file may claim any number
MOST_GROWTH = 64


def damaged(path: Path, reason: str) -> DataError:
    """The error for a file that cannot be read for this reason."""
    return DataError(
        "{path} cannot be read as Gaussians: {reason}.",
        "Export or copy the file again.",
        path=path,
        reason=reason,
    )


@contextmanager
def needing_packages() -> Iterator[None]:
    """Name the extra where a package of it is not installed.

    Raises:
        MissingDependency: It is not.
    """
    try:
        yield
    except ImportError as error:
        if is_out_of_memory(error):
            raise
        raise missing_extra(error.name or "gsply", EXTRA) from error


@contextmanager
def explaining(path: Path) -> Iterator[None]:
    """Turn whatever a parser or a package raises about a file's content into a sentence.

    Raises:
        MissingDependency: The package is not installed.
        DataError: The file is damaged.
    """
    try:
        with needing_packages():
            yield
    except Exception as error:  # packages raise anything
        if isinstance(error, KarfError | UnicodeEncodeError) or is_out_of_memory(error):
            raise
        raise damaged(path, _words(error)) from error


def _words(error: Exception) -> str:
    if isinstance(error, KeyError):
        return f"it lacks {error.args[0]!r}"
    return " ".join(str(error).split()).rstrip(".") or type(error).__name__


def check_count(path: Path, count: int, n_harmonics: int, size: int) -> None:
    """Refuse to make room for Gaussians that cannot be in a file; called before their arrays are made.

    Args:
        path: The file, for messages.
        count: How many Gaussians it says that it has.
        n_harmonics: K of each, 1 to 16.
        size: Bytes of the file, packed as it is, with those that it refers to.

    Raises:
        DataError: There are none, or more than any file so small holds, or than are read of any file.
    """
    table = 4 * count * (COLOR + 3 * n_harmonics)  # bytes
    if not 0 < table <= min(MOST_GROWTH * size, MOST_BYTES):
        raise damaged(path, f"it says that it has {count:,} Gaussians, in {size:,} bytes")


def checked(path: Path, table: np.ndarray) -> np.ndarray:
    """A table as `SplatFile` holds it.

    Args:
        path: Where it was read, for messages.
        table: [n, 11 + 3 K] of any floating type; logits and logarithms of scales may be infinite where the opacity is
            0 or 1, the scale 0.

    Returns:
        [n, 11 + 3 K] float32, C-contiguous: logits and logarithms of scales within what float32 can tell.

    Raises:
        DataError: It is empty, or a row cannot be a Gaussian; names the first such row and what is wrong with it.
    """
    if len(table) == 0:
        raise damaged(path, "it has no Gaussians")
    with np.errstate(over="ignore"):
        table = np.array(table, np.float32, order="C")
    centers, scales, rotations = table[:, :LOG_SCALE], table[:, LOG_SCALE:ROTATION], table[:, ROTATION:LOGIT]
    lengths = np.linalg.norm(rotations.astype(np.float64), axis=1)
    # not-a-number fails every comparison
    _refuse(path, "a center that is not finite", (np.abs(centers) <= LARGEST_POSITION).all(1))
    _refuse(path, "a scale that is not finite", (scales <= LOG_SCALES[1]).all(1))
    _refuse(path, "a rotation that is no quaternion", (lengths >= LENGTHS[0]) & (lengths <= LENGTHS[1]))
    _refuse(path, "an opacity that is not a number", ~np.isnan(table[:, LOGIT]))
    _refuse(path, "a color that is not finite", (np.abs(table[:, COLOR:]) <= LARGEST_HARMONIC).all(1))
    np.clip(scales, *LOG_SCALES, out=scales)
    np.clip(table[:, LOGIT], *LOGITS, out=table[:, LOGIT])
    return table


def _refuse(path: Path, what: str, are_good: np.ndarray) -> None:
    if not are_good.all():
        row = int(np.argmin(are_good))
        raise DataError(
            "{path} cannot be read as Gaussians: row {row} of {count}, counted from 0, has {what}.",
            "Remove such Gaussians in the program that wrote the file, and export it again.",
            path=path,
            row=row,
            count=len(are_good),
            what=what,
        )


def logits(opacities: np.ndarray) -> np.ndarray:
    """Logits of opacities in [0, 1], any shape, float64; infinite at the ends, not-a-number beyond them."""
    opacities = np.asarray(opacities, np.float64)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.log(opacities) - np.log1p(-opacities)


def opacities(logits: np.ndarray) -> np.ndarray:
    """Opacities in [0, 1] of logits, any shape, float32."""
    return (1 / (1 + np.exp(-np.asarray(logits, np.float64)))).astype(np.float32)


def log_scales(scales: np.ndarray) -> np.ndarray:
    """Logarithms of scales, any shape, float64; infinite at 0, not-a-number below."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.log(np.asarray(scales, np.float64))
