"""Estimate the duration of each stage from a computer's speed and the settings."""

from __future__ import annotations

from .stages import Level, Settings

# costs in geometry samples, measured with the preset demo
SEGMENTATION, RECOLORING = 74.0, 93.0  # of one ray of a batch, for a head of width `WIDTH`
WIDTH = 64
SPLATS, MAX_SIDE = 0.6, 400  # of one pixel of a photo; larger photos are learned in windows of this side


def seconds_of_stages(settings: Settings, samples_per_second: float, is_open: bool = False) -> dict[str, float] | None:
    """Estimate the seconds that each stage of learning takes.

    Args:
        settings: The settings of the stages.
        samples_per_second: Samples of the geometry that the computer learns from in a second, see `cli.doctor.speed`.
        is_open: Whether the scene extends behind the object and the cameras.

    Returns:
        Seconds by stage; None for fields other than voxels.
    """
    if settings.geometry.field != "voxels":
        return None
    levels, samples = settings.geometry.levels, settings.geometry.samples
    if is_open:
        levels, samples = settings.geometry.open.levels, settings.geometry.open.samples
    segmentation, recoloring, splats = settings.segmentation, settings.recoloring, settings.splats
    work = {
        "geometry": _iterations(levels) * samples,
        "segmentation": SEGMENTATION * segmentation.iterations * segmentation.batch * segmentation.width / WIDTH,
        "recoloring": RECOLORING * recoloring.iterations * recoloring.batch * recoloring.width / WIDTH,
        "splats": SPLATS * splats.iterations * min(splats.long_side, MAX_SIDE) ** 2,
    }
    return {stage: samples / samples_per_second for stage, samples in work.items()}


def _iterations(levels: tuple[Level, ...]) -> int:
    return sum(level.iterations for level in levels)
