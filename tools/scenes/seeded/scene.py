"""What a drawn scene holds, as values (standard library only). Lengths are scene units; colors scene linear."""

from __future__ import annotations

from dataclasses import dataclass

Color = tuple[float, float, float]
Point = tuple[float, float, float]

PLACES = ("table", "shelf", "garden", "room")
LIGHTS = ("sun", "lamps", "overcast")
BACKGROUNDS = ("gradient", "plain", "matte")
RELATIONS = ("none", "same hue", "twin", "part", "touching", "behind wires", "behind leaves")


@dataclass(frozen=True)
class Paint:
    """One color, or two that a pattern mixes.

    Attributes:
        colors: The main color, and maybe the second.
        pattern: `plain`, `bands`, `checks`, `clouds` or `rise`.
        roughness: 0 mirrors, 1 is matte.
        translucency: Share of the light that enters and leaves elsewhere, in [0, 1].
    """

    colors: tuple[Color, ...]
    pattern: str
    roughness: float
    translucency: float = 0.0


@dataclass(frozen=True)
class Thing:
    """A thing that stands somewhere.

    Attributes:
        name: Of it and of its material.
        form: Which of the forms it has.
        proportions: Seed of its own proportions: things of one form and seed have the same shape.
        size: About its height or width, whichever is more.
        position: Where its foot is.
        azimuth: How it is turned about z, radians.
        paint: Its color.
        object_id: Its number among the marked things, from 1; 0 for one without a mask.
    """

    name: str
    form: str
    proportions: int
    size: float
    position: Point
    azimuth: float
    paint: Paint
    object_id: int = 0


@dataclass(frozen=True)
class Cameras:
    """Where the photos are taken from.

    Attributes:
        way: `dome` (all round), `patch` (one way) or `path` (a hand-held walk round a part of it).
        train: Training photos.
        distance: From the target.
        target: What they look at.
        field_of_view: Radians.
        seed: Of their jitter.
    """

    way: str
    train: int
    distance: float
    target: Point
    field_of_view: float
    seed: int


@dataclass(frozen=True)
class PhotoFlaws:
    """What is wrong with the training photos; test photos are clean.

    Attributes:
        noise: Deviation of each channel of each pixel, sRGB in [0, 1].
        blur: Deviation of a Gaussian, pixels.
        drift: Largest change of exposure between photos, as a factor's distance from 1.
    """

    noise: float
    blur: float
    drift: float


@dataclass(frozen=True)
class Scene:
    """All that a seed says.

    Attributes:
        seed: The seed.
        place: One of PLACES.
        light: One of LIGHTS.
        background: One of BACKGROUNDS; a place other than a table has always its own surroundings.
        relation: What stands beside the first marked thing to mislead: one of RELATIONS.
        things: All of them; the marked ones first.
        cameras: The cameras.
        flaws: Of the training photos.
        repaints: Edit -> thing -> its new colors.
    """

    seed: int
    place: str
    light: str
    background: str
    relation: str
    things: tuple[Thing, ...]
    cameras: Cameras
    flaws: PhotoFlaws
    repaints: dict[str, dict[str, tuple[Color, ...]]]

    @property
    def marked(self) -> tuple[Thing, ...]:
        """The things that have masks, by number."""
        return tuple(thing for thing in self.things if thing.object_id)
