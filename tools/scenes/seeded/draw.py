"""A seed's scene (numpy and the standard library only): the same seed and attempt give the same scene."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from .paints import draw_paint, draw_repaints, like
from .scene import BACKGROUNDS, LIGHTS, PLACES, RELATIONS, Cameras, PhotoFlaws, Point, Scene, Thing

# half of the width of each form of size 1, and its height
FORMS = {
    "vase": (0.32, 1.0),
    "bowl": (0.50, 0.45),
    "gourd": (0.50, 0.85),
    "block": (0.55, 0.75),
    "ring": (0.50, 1.0),
    "stone": (0.50, 0.60),
    "cup": (0.40, 0.75),
    "plant": (0.42, 1.0),
    "cage": (0.36, 0.95),
}
MARKED_MOST = 3
FEW_PHOTOS, PHOTOS = 14, 36
FEW_SHARE = 0.2
TRIES = 300


class Crowded(Exception):
    """A marked thing found no free spot."""


@dataclass(frozen=True)
class Support:
    """A disk or a rectangle that things stand on: center, half the sides, and the free height above."""

    center: Point
    half_sides: tuple[float, float]
    headroom: float = math.inf
    is_round: bool = False

    def draw_spot(self, rng: np.random.Generator, radius: float) -> Point:
        """Return a spot for a thing of such a radius, free or not."""
        room = [max(side - 0.6 * radius, 0.0) for side in self.half_sides]
        x, y = rng.uniform(-1, 1, 2)
        while self.is_round and math.hypot(x, y) > 1:
            x, y = rng.uniform(-1, 1, 2)
        return self.center[0] + x * room[0], self.center[1] + y * room[1], self.center[2]

    def holds(self, spot: Point, radius: float) -> bool:
        """Test whether a thing of this radius, at this spot, stands on it."""
        x, y = ((spot[k] - self.center[k]) / max(self.half_sides[k] - 0.4 * radius, 1e-6) for k in range(2))
        return math.hypot(x, y) <= 1 if self.is_round else max(abs(x), abs(y)) <= 1


SUPPORTS = {
    "table": (Support((0.0, 0.0, 0.0), (1.35, 1.35), is_round=True),),
    "garden": (Support((0.0, 0.0, 0.0), (1.9, 1.9), is_round=True),),
    "room": (Support((0.0, 0.2, 0.0), (1.7, 0.9)),),
    "shelf": (Support((0.0, 0.0, 0.0), (1.5, 0.30), 1.0), Support((0.0, 0.0, 1.2), (1.5, 0.30), 1.0)),
}
SIZES = {"table": (0.45, 1.0), "garden": (0.6, 1.4), "room": (0.45, 1.0), "shelf": (0.45, 0.9)}
COUNTS = {"table": (3, 8), "garden": (5, 12), "room": (4, 9), "shelf": (6, 12)}
WAYS = {"table": ("dome", "dome", "path"), "garden": ("dome", "path"), "room": ("path", "patch"), "shelf": ("patch",)}
TARGETS = {"table": (0.0, 0.0, 0.35), "garden": (0.0, 0.0, 0.45), "room": (0.0, 0.2, 0.45), "shelf": (0.0, 0.0, 0.95)}
DISTANCES = {"table": 3.6, "garden": 4.8, "room": 3.9, "shelf": 4.0}
FIELD_OF_VIEW = math.radians(40.0)


def draw_scene(seed: int, attempt: int = 0) -> Scene:
    """Return the scene of a seed.

    Args:
        seed: The seed. Places take turns; all else is drawn.
        attempt: Another number draws another scene in the same place, for one whose marked things cannot be seen.
    """
    rng = np.random.default_rng((seed, attempt))
    place = PLACES[seed % len(PLACES)]
    things, relation = _draw_things(place, rng)
    marked = {thing.name: thing.paint for thing in things if thing.object_id}
    return Scene(
        seed=seed,
        place=place,
        light=str(rng.choice(LIGHTS)),
        background=str(rng.choice(BACKGROUNDS)) if place == "table" else BACKGROUNDS[0],
        relation=relation,
        things=things,
        cameras=_draw_cameras(place, rng),
        flaws=PhotoFlaws(rng.uniform(0, 0.02), rng.uniform(0, 0.6), rng.uniform(0, 0.06)),
        repaints=draw_repaints(marked, rng),
    )


def _draw_cameras(place: str, rng: np.random.Generator) -> Cameras:
    way = str(rng.choice(WAYS[place]))
    train = FEW_PHOTOS if way != "patch" and rng.random() < FEW_SHARE else PHOTOS
    distance = DISTANCES[place] * rng.uniform(0.92, 1.08)
    return Cameras(way, train, distance, TARGETS[place], FIELD_OF_VIEW, int(rng.integers(2**31)))


def _draw_things(place: str, rng: np.random.Generator) -> tuple[tuple[Thing, ...], str]:
    """Return the things, marked ones first, and how the first of them is beside another that misleads."""
    while True:
        arrangement = Arrangement(place, rng)
        relation = str(rng.choice(RELATIONS))
        try:
            first = arrangement.add(1)
            _relate(arrangement, first, relation)
            for number in range(2, 1 + int(rng.integers(1, MARKED_MOST + 1))):
                arrangement.add(number)
        except Crowded:
            continue
        _fill(arrangement, int(rng.integers(*COUNTS[place], endpoint=True)))
        things = sorted(arrangement.things, key=lambda thing: thing.object_id or math.inf)
        return tuple(things), relation


def _fill(arrangement: Arrangement, count: int) -> None:
    """Add unmarked things until there are this many, or no more fit."""
    try:
        while len(arrangement.things) < count:
            arrangement.add(0)
    except Crowded:
        return


def _relate(arrangement: Arrangement, first: Thing, relation: str) -> None:
    """Add the thing that misleads about the first one."""
    rng = arrangement.rng
    if relation == "same hue":
        arrangement.add(0, beside=first, paint=like(first.paint, rng))
    elif relation == "twin":
        arrangement.add(0, form=first.form, proportions=first.proportions, paint=first.paint, size=first.size)
    elif relation == "part":
        arrangement.add(0, beside=first, paint=first.paint, size=0.5 * first.size)
    elif relation == "touching":
        arrangement.add(0, beside=first)
    elif relation == "behind leaves":
        arrangement.add(0, form="plant", beside=first)
    elif relation == "behind wires":
        arrangement.enclose(first)


class Arrangement:
    """Things that stand in a place without being in each other."""

    def __init__(self, place: str, rng: np.random.Generator) -> None:
        self.rng, self.things = rng, []
        self._supports, self._sizes = SUPPORTS[place], SIZES[place]

    def add(self, object_id: int, *, beside: Thing | None = None, **wanted) -> Thing:
        """Add a thing with what is wanted of it, the rest drawn, at a free spot or touching another.

        Raises:
            Crowded: There is no such spot.
        """
        rng = self.rng
        form = wanted.get("form") or str(rng.choice([form for form in FORMS if not object_id or form != "cage"]))
        drawn = {"proportions": int(rng.integers(2**31)), "size": rng.uniform(*self._sizes), "paint": draw_paint(rng)}
        drawn |= wanted | {"form": form}
        for _ in range(TRIES):
            support = self._supports[rng.integers(len(self._supports))]
            size = min(drawn["size"], support.headroom / FORMS[form][1])
            thing = Thing(
                f"{form}_{len(self.things) + 1}",
                position=self._spot(support, size * FORMS[form][0], beside),
                azimuth=rng.uniform(0, 2 * math.pi),
                object_id=object_id,
                **drawn | {"size": size},
            )
            if self._is_free(thing, support, beside):
                self.things.append(thing)
                return thing
        raise Crowded

    def enclose(self, inner: Thing) -> None:
        """Put a cage of wires round a thing."""
        size = 1.25 * max(radius_of(inner) / FORMS["cage"][0], inner.size * FORMS[inner.form][1] / FORMS["cage"][1])
        paint = replace(draw_paint(self.rng), translucency=0.0)
        name, seed = f"cage_{len(self.things) + 1}", int(self.rng.integers(2**31))
        self.things.append(Thing(name, "cage", seed, size, inner.position, 0.0, paint))

    def _spot(self, support: Support, radius: float, beside: Thing | None) -> Point:
        if beside is None:
            return support.draw_spot(self.rng, radius)
        angle, distance = self.rng.uniform(0, 2 * math.pi), radius + radius_of(beside)
        x, y, z = beside.position
        return x + distance * math.cos(angle), y + distance * math.sin(angle), z

    def _is_free(self, thing: Thing, support: Support, beside: Thing | None) -> bool:
        if not support.holds(thing.position, radius_of(thing)):
            return False
        others = [other for other in self.things if other is not beside]
        return all(_distance(thing, other) >= radius_of(thing) + radius_of(other) for other in others)


def radius_of(thing: Thing) -> float:
    """Return half of the width of a thing."""
    return thing.size * FORMS[thing.form][0]


def _distance(a: Thing, b: Thing) -> float:
    if a.position[2] != b.position[2]:
        return math.inf  # on other boards
    return math.dist(a.position[:2], b.position[:2])
