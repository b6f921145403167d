"""A seed's scene of things with thin parts on purpose (numpy and the standard library only)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .draw import DISTANCES, FIELD_OF_VIEW, TARGETS, THIN_FORMS, Arrangement, Crowded
from .paints import draw_paint, like, repainted
from .scene import BACKGROUNDS, LIGHTS, Cameras, Paint, PhotoFlaws, Scene, Thing

PLACES = ("table", "garden", "room")
WAYS = {"table": ("dome",), "garden": ("dome", "path"), "room": ("path",)}
STREAM = 31  # keeps these draws apart from those of the other drawn scenes of a seed
MARKED, OTHERS = 2, 2
PHOTOS = 24
SIZES = (0.75, 1.0)
NEARER = 0.86  # of a drawn scene's distance: a wire shall be seen
SOLID = ("vase", "bowl", "gourd", "block", "stone")


def draw_thin_scene(seed: int, attempt: int = 0) -> Scene:
    """Return the scene of a seed: two marked things with thin parts, one of the first one's hue, and two others.

    Args:
        seed: The seed. Places take turns; all else is drawn.
        attempt: Another number draws another scene in the same place, for one whose marked things cannot be seen.
    """
    rng = np.random.default_rng((seed, attempt, STREAM))
    place = PLACES[seed % len(PLACES)]
    things = _draw_things(place, rng)
    way, distance = str(rng.choice(WAYS[place])), NEARER * DISTANCES[place] * rng.uniform(0.95, 1.05)
    turns = {thing.name: (rng.uniform(0.25, 0.75), rng.uniform(0.8, 1.4)) for thing in things if thing.object_id}
    return Scene(
        seed=seed,
        place=place,
        light=str(rng.choice(LIGHTS)),
        background=str(rng.choice(BACKGROUNDS[:2])) if place == "table" else BACKGROUNDS[0],
        relation="same hue",
        things=things,
        cameras=Cameras(way, PHOTOS, distance, TARGETS[place], FIELD_OF_VIEW, int(rng.integers(2**31))),
        flaws=PhotoFlaws(rng.uniform(0, 0.01), rng.uniform(0, 0.4), rng.uniform(0, 0.04)),
        repaints={"all": {t.name: (repainted(t.paint.colors[0], *turns[t.name]),) for t in things if t.object_id}},
    )


def _draw_things(place: str, rng: np.random.Generator) -> tuple[Thing, ...]:
    """Return the things, marked ones first."""
    forms = rng.choice(tuple(THIN_FORMS), MARKED, replace=False)
    while True:
        arrangement = Arrangement(place, rng)
        try:
            for number, form in enumerate(forms, 1):
                arrangement.add(number, form=str(form), size=rng.uniform(*SIZES), paint=_plain(rng))
            first = arrangement.things[0]
            arrangement.add(0, form=str(rng.choice(SOLID)), beside=first, paint=like(first.paint, rng))
            for _ in range(OTHERS):
                arrangement.add(0, form=str(rng.choice(SOLID)), paint=replace(draw_paint(rng), translucency=0.0))
        except Crowded:
            continue
        return tuple(arrangement.things)


def _plain(rng: np.random.Generator) -> Paint:
    """Return a drawn paint of one color: a pattern would hide which part of a thing is lost."""
    paint = draw_paint(rng)
    return Paint(paint.colors[:1], "plain", paint.roughness)
