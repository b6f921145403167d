"""Gaussians on disk: `splats.safetensors`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import torch

from ..io.checkpoints import damage_as_data_error, load_tensors, save_tensors
from .gaussians import DEGREES, Gaussians, subset
from .kernels.arrays import COLOR, PIXEL_FILTER, ScreenFilter

SCHEMA = "karf-splats/1"
FILTERED_SCHEMA = "karf-splats/2"  # with another screen filter than PIXEL_FILTER, which readers of version 1 assume
ERASED_SCHEMA = "karf-splats/3"  # with erased Gaussians, which readers of earlier versions would show
LOOK_COLUMNS = 5


def save_gaussians(gaussians: Gaussians, path: Path, erased: np.ndarray | None = None) -> None:
    """Write Gaussians; `load_gaussians` leaves out erased ones, [n] bool."""
    facts = {"n_behind": gaussians.n_background, "background": list(gaussians.background), "near": gaussians.near}
    schema = SCHEMA
    if gaussians.screen_filter != PIXEL_FILTER:
        schema, facts["screen_filter"] = FILTERED_SCHEMA, list(map(float, gaussians.screen_filter))
    arrays = {"table": gaussians.table} | ({} if gaussians.visibility is None else {"looks": gaussians.visibility})
    if erased is not None and erased.any():
        schema, arrays["erased"] = ERASED_SCHEMA, erased
    save_tensors(path, {name: torch.from_numpy(each) for name, each in arrays.items()}, schema, facts)


def load_gaussians(path: Path) -> Gaussians:
    """Read Gaussians written by `save_gaussians`, without erased ones. Raises DataError as `load_all_gaussians`."""
    gaussians, erased = load_all_gaussians(path)
    return subset(gaussians, np.flatnonzero(~erased)) if erased.any() else gaussians


def load_all_gaussians(path: Path) -> tuple[Gaussians, np.ndarray]:
    """Read all Gaussians of a file, and which of them are erased, [n] bool.

    Raises DataError if the file is missing or damaged.
    """
    tensors, facts = load_tensors(path, (SCHEMA, FILTERED_SCHEMA, ERASED_SCHEMA))
    with damage_as_data_error(path):
        table, n_behind, near = tensors["table"].numpy(), facts["n_behind"], float(facts["near"])
        n_harmonics = (table.shape[1] - COLOR) / 3
        if table.dtype != np.float32 or table.ndim != 2 or n_harmonics not in DEGREES:
            raise ValueError(f"a table {table.shape} of {table.dtype}")
        if not isinstance(n_behind, int) or not 0 <= n_behind <= len(table) or not 0 < near < np.inf:
            raise ValueError(f"{n_behind} of {len(table)} behind, near {near}")
        red, green, blue = map(float, facts["background"])
        if not np.isfinite((red, green, blue)).all():
            raise ValueError(f"a background {red} {green} {blue}")
        blur, least_share = map(np.float32, facts.get("screen_filter", PIXEL_FILTER))
        if not (0 < blur < np.inf and 0 < least_share <= 1):
            raise ValueError(f"a screen filter {blur} {least_share}")
        looks = tensors["looks"].numpy() if "looks" in tensors else None
        if looks is not None and (looks.dtype != np.float32 or looks.shape != (len(table), LOOK_COLUMNS)):
            raise ValueError(f"looks {looks.shape} of {looks.dtype} at a table {table.shape}")
        erased = tensors["erased"].numpy() if "erased" in tensors else np.zeros(len(table), bool)
        if erased.dtype != bool or erased.shape != (len(table),):
            raise ValueError(f"erased {erased.shape} of {erased.dtype} at a table {table.shape}")
    screen_filter = ScreenFilter(blur, least_share)
    table = np.ascontiguousarray(table)
    return Gaussians(table, n_behind, (red, green, blue), near, screen_filter, looks), erased
