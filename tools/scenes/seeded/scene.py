"""The values of a drawn scene (standard library only). Lengths are scene units; colors scene linear."""

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
    """One color, or two that a pattern mixes."""

    colors: tuple[Color, ...]  # the main color, and maybe the second
    pattern: str  # plain, bands, checks, clouds or rise
    roughness: float  # 0 mirrors, 1 is matte
    translucency: float = 0.0  # share of the light that enters and leaves elsewhere, in [0, 1]


@dataclass(frozen=True)
class Thing:
    """A thing that stands somewhere."""

    name: str  # of it and of its material
    form: str
    proportions: int  # seed: things of one form and seed have the same shape
    size: float  # about its height or width, whichever is more
    position: Point  # of its foot
    azimuth: float  # radians about z
    paint: Paint
    object_id: int = 0  # number among the marked things, from 1; 0 for one without a mask


@dataclass(frozen=True)
class Cameras:
    """Where the photos are taken from."""

    way: str  # dome (all round), patch (one way) or path (a hand-held walk round a part)
    train: int  # training photos
    distance: float
    target: Point
    field_of_view: float  # radians
    seed: int  # of their jitter


@dataclass(frozen=True)
class PhotoFlaws:
    """The flaws of the training photos; test photos are clean."""

    noise: float  # deviation of each channel of each pixel, sRGB in [0, 1]
    blur: float  # deviation of a Gaussian, pixels
    drift: float  # largest change of exposure between photos, as a factor's distance from 1


@dataclass(frozen=True)
class Scene:
    """All that a seed draws."""

    seed: int
    place: str  # one of PLACES
    light: str  # one of LIGHTS
    background: str  # one of BACKGROUNDS, of a table; other places have their own surroundings
    relation: str  # what is beside the first marked thing to mislead: one of RELATIONS
    things: tuple[Thing, ...]  # the marked ones first
    cameras: Cameras
    flaws: PhotoFlaws
    repaints: dict[str, dict[str, tuple[Color, ...]]]  # edit -> thing -> its new colors

    @property
    def marked(self) -> tuple[Thing, ...]:
        """The things that have masks, by number."""
        return tuple(thing for thing in self.things if thing.object_id)
