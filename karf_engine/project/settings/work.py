"""How long stages take with given settings, from how fast a computer learns from samples.

The shares were measured with the preset demo on its own capture; what a computer really took corrects them.
"""

from __future__ import annotations

from .stages import Level, Settings

SEGMENTATION, RECOLORING = 74.0, 93.0  # samples of the geometry that take as long as one ray of a batch ...
WIDTH = 64  # ... for a head with layers of this width
SPLATS, MOST_SIDE = 0.6, 400  # as long as one pixel of a photo; of larger photos a window is learned from at a time


def seconds_of_stages(settings: Settings, samples_per_second: float, is_open: bool = False) -> dict[str, float] | None:
    """Seconds of each stage of learning, on one computer.

    Args:
        settings: With which the stages run.
        samples_per_second: Samples that a fit of the geometry learns from in a second, see `cli.doctor.speed`.
        is_open: Whether the scene extends behind the object and the cameras.

    Returns:
        By stage; None for a kind of field that was not measured.
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
        "splats": SPLATS * splats.iterations * min(splats.long_side, MOST_SIDE) ** 2,
    }
    return {stage: samples / samples_per_second for stage, samples in work.items()}


def _iterations(levels: tuple[Level, ...]) -> int:
    return sum(level.iterations for level in levels)
