"""The presets, by name."""

from __future__ import annotations

from ...errors import BadRequest
from .stages import (
    GeometrySettings,
    Level,
    OpenSettings,
    PaletteSettings,
    RecoloringSettings,
    SegmentationSettings,
    Settings,
    SplatSettings,
)

PRESETS: dict[str, Settings] = {
    # two processor cores, a few minutes on photos of 256 pixels
    "demo": Settings(),
    # a laptop, about two minutes on photos of 400 pixels: more and finer cells, more samples per iteration
    "fast": Settings(
        preset="fast",
        geometry=GeometrySettings(
            long_side=400,
            levels=(Level(48, 120, 1.0), Level(112, 250, 0.75), Level(240, 500, 0.6)),
            samples=120_000,
            open=OpenSettings(levels=(Level(64, 150, 1.0), Level(128, 250, 1.0), Level(256, 600, 1.0))),
        ),
        segmentation=SegmentationSettings(cache_long_side=200, iterations=300),
        splats=SplatSettings(iterations=1200, count=80_000, long_side=400),
    ),
    # a laptop, ten minutes: as fine as fits in 4 GB of memory
    "fine": Settings(
        preset="fine",
        geometry=GeometrySettings(
            long_side=400,
            levels=(Level(48, 120, 1.0), Level(112, 250, 0.75), Level(240, 500, 0.6), Level(360, 1500, 0.6)),
            samples=120_000,
            open=OpenSettings(
                levels=(Level(64, 150, 1.0), Level(128, 250, 1.0), Level(256, 600, 1.0), Level(448, 2400, 1.0)),
                frustum_detail=1.2,
            ),
        ),
        segmentation=SegmentationSettings(cache_long_side=200, iterations=300),
        splats=SplatSettings(iterations=3000, count=100_000, long_side=400),
    ),
    # a graphics card, 800 pixels; heads of the paper's width
    "quality": Settings(
        preset="quality",
        geometry=GeometrySettings(
            long_side=800,
            levels=(Level(64, 500, 1.0), Level(160, 1500, 0.75), Level(384, 6000, 0.5)),
            samples=1_000_000,
            max_rays=65536,
            features=24,
            open=OpenSettings(
                levels=(Level(64, 500, 1.0), Level(160, 1500, 1.0), Level(448, 6000, 1.0)),
                samples=1_000_000,
                max_rays=65536,
            ),
        ),
        segmentation=SegmentationSettings(width=256, iterations=1000, batch=4096, cache_views=48, cache_long_side=400),
        recoloring=RecoloringSettings(width=256, frequencies=8, direction_frequencies=4, batch=4096),
        splats=SplatSettings(iterations=8000, count=200_000, long_side=1600, degree=3),
    ),
    # the paper's numbers and losses, for a graphics card: NeRF, plain Eq. 12, one palette of LoCoPalettes' size and its
    # weights in the marked views, a black background, the paper's compositing; docs/paper.md lists the differences
    "paper": Settings(
        preset="paper",
        compositing="paper",
        geometry=GeometrySettings(field="nerf", long_side=800),
        segmentation=SegmentationSettings(
            labels="masks",
            width=256,
            frequencies=10,
            iterations=2000,
            rate=5e-4,
            schedule="constant",
            cache_views=32,
            cache_long_side=256,
            samples_per_ray=64,
        ),
        palette=PaletteSettings(shared=True, colors=6),
        recoloring=RecoloringSettings(
            width=256,
            schedule="constant",
            frequencies=10,
            direction_frequencies=4,
            iterations=5000,
            batch=1024,
            rate=5e-4,
            targets="loco",
            supervision="reference",
            background="black",
        ),
        splats=SplatSettings(iterations=0),
    ),
}


def preset(name: str) -> Settings:
    """Return the preset of this name. Raises BadRequest listing the known ones."""
    if name not in PRESETS:
        raise BadRequest(f"Unknown preset {name!r}.", f"Use one of: {', '.join(PRESETS)}.")
    return PRESETS[name]
