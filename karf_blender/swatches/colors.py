"""The swatches of a scene as palette states, and back (see `solving`), and its light."""

from collections.abc import Iterable

import bpy
import numpy as np

from ..engine_api import (
    AddedColor,
    BadRequest,
    EdgeShape,
    Palette,
    ReferenceLight,
    Surface,
    hex_to_rgb,
    to_mean_exposure,
)
from .solving import Becoming, PaletteState, States

BY_PAINT = "PAINT"  # of an object's `scope`
SURFACE = ("saturation", "brightness", "gloss")


# --- reading -------------------------------------------------------------------------------------------------------
def state(item: bpy.types.PropertyGroup) -> PaletteState:
    """Return an object's swatches."""
    flags = {name: _numbers(item, name, bool) for name in ("locked", "is_added", "is_paint")}
    numbers = {name: _numbers(item, name, np.int32) for name in ("link", "merged")}
    shares = {name: _numbers(item, name, np.float32) for name in ("reach", "protect")}
    surface = np.stack([_numbers(item, name, np.float32) for name in SURFACE], axis=-1)
    rest = {"shift": stored(item, "shift"), "surface": surface, "is_metal": item.is_metal}
    rest["by_paint"] = item.scope == BY_PAINT
    return PaletteState(item.name, learned(item), chosen(item), **flags, **numbers, **shares, **rest)


def states(scene: bpy.types.Scene) -> States:
    """Return the swatches of all objects, by name."""
    return {item.name: state(item) for item in scene.karf.objects}


def stored(item: bpy.types.PropertyGroup, name: str) -> np.ndarray:
    """Return a color property of all swatches of an object, [M, 3] float32."""
    flat = np.empty(len(item.swatches) * 3, np.float32)
    item.swatches.foreach_get(name, flat)
    return flat.reshape(-1, 3)


def _numbers(item: bpy.types.PropertyGroup, name: str, kind: type) -> np.ndarray:
    values = np.empty(len(item.swatches), kind)
    item.swatches.foreach_get(name, values)
    return values


def learned(item: bpy.types.PropertyGroup) -> np.ndarray:
    """Return an object's palette as learned with the sets of its added colors, [M, 3]."""
    return stored(item, "learned")


def chosen(item: bpy.types.PropertyGroup) -> np.ndarray:
    """Return the colors that an object's swatches were given, [M, 3]; black stays black."""
    colors = stored(item, "color")
    colors[:1] = learned(item)[:1]
    return colors


def edited(item: bpy.types.PropertyGroup) -> np.ndarray:
    """Return the colors that an object is shown with, [M, 3]."""
    return state(item).edited


def surface_of(swatch: bpy.types.PropertyGroup) -> Surface:
    """Return the surface of a swatch; merged swatches are neutral."""
    return Surface() if swatch.merged else Surface(*(getattr(swatch, name) for name in SURFACE))


def size(item: bpy.types.PropertyGroup) -> int:
    """Count the learned swatches of an object, black among them; sets of added colors follow them."""
    return state(item).size


def palettes(scene: bpy.types.Scene) -> tuple[Palette, ...]:
    """Return the palettes of a scene's objects as learned, without added colors."""
    return tuple(each.palette for each in states(scene).values())


def added(item: bpy.types.PropertyGroup) -> tuple[AddedColor, ...]:
    """Return the added colors of an object, idle ones among them."""
    return state(item).added


def has_paints(item: bpy.types.PropertyGroup) -> bool:
    """Tell whether an object has paints that can be changed apart."""
    return any(swatch.is_paint for swatch in item.swatches)


def offered(item: bpy.types.PropertyGroup) -> list[int]:
    """Return the numbers of the swatches that the artist sees: of its paints, or those learned, and those added."""
    by_paint = item.scope == BY_PAINT and has_paints(item)
    return [
        index
        for index, swatch in enumerate(item.swatches)
        if index and not swatch.merged and (swatch.is_paint == by_paint or (swatch.is_added and not swatch.is_paint))
    ]


def added_by_object(scene: bpy.types.Scene) -> dict[str, tuple[AddedColor, ...]]:
    """Return the added colors of the objects that have some, by name; no idle ones."""
    kept = {name: tuple(color for color in each.added if color.reach) for name, each in states(scene).items()}
    return {name: own for name, own in kept.items() if own}


def keys(added_colors: Iterable[AddedColor]) -> list[tuple[float, ...]]:
    """Return what makes added colors the same ones, as comparable values."""
    return [(*color.picked.tolist(), color.reach, color.protect) for color in added_colors]


def edges(scene: bpy.types.Scene) -> dict[str, EdgeShape]:
    """Return how the edges of objects are moved and faded, by name; none of those that stay as they are."""
    shapes = {item.name: EdgeShape(item.choke, item.feather) for item in scene.karf.objects}
    return {name: shape for name, shape in shapes.items() if not shape.is_neutral}


def fingerprint(scene: bpy.types.Scene) -> bytes:
    """Return all that keyframes can change in a picture, as one comparable value."""
    parts = (stored(item, name).tobytes() for item in scene.karf.objects for name in ("color", "shift"))
    return b"".join([repr((scene.karf.compositing, scene.karf.active_view, edges(scene))).encode(), *parts])


def place_of(swatch: bpy.types.PropertyGroup) -> tuple[bpy.types.PropertyGroup, int]:
    """Return a swatch's object, and its number there."""
    places = ((item, index) for item in swatch.id_data.karf.objects for index in range(len(item.swatches)))
    return next((item, index) for item, index in places if item.swatches[index] == swatch)


# --- the pair of colors of Becomes ---------------------------------------------------------------------------------
def color_pair(item: bpy.types.PropertyGroup) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return an object's source and target color, which are equal before a target is chosen."""
    return tuple(item.source), tuple(item.target)


def becoming(item: bpy.types.PropertyGroup) -> Becoming:
    """Return what an object's source color becomes; its start is the learned palette before any source was picked."""
    source, before = to_mean_exposure(np.array(item.source, np.float32), item.gains), stored(item, "before")
    start = before if before.any() else learned(item)
    rule = "paint" if item.scope == BY_PAINT and has_paints(item) else "becomes"
    return Becoming(source, np.array(item.target, np.float32), rule, start, held(item))


def held(item: bpy.types.PropertyGroup) -> list[np.ndarray]:
    """Return colors that other paints of an object were given before, sRGB [3] each."""
    return [hex_to_rgb(text) for text in item.held.split()]


# --- writing -------------------------------------------------------------------------------------------------------
def write(item: bpy.types.PropertyGroup, wanted: np.ndarray, name: str = "color") -> None:
    """Give an object's swatches these colors [M, 3], those that differ; `gestures.suspended` while others must not follow."""
    for swatch, before, color in zip(item.swatches, stored(item, name), wanted, strict=True):
        if (before != color).any():
            setattr(swatch, name, color)


def write_surface(swatch: bpy.types.PropertyGroup, surface: Surface) -> None:
    """Give a swatch a surface."""
    for name in SURFACE:
        if getattr(swatch, name) != getattr(surface, name):
            setattr(swatch, name, getattr(surface, name))


# --- the light of color books, by a color chart or a gray card in a photo -------------------------------------------
def reference_light(scene: bpy.types.Scene) -> ReferenceLight | None:
    """Return how the scene's light differs from daylight (D65), by its chart, else by its card; None without both."""
    if has_chart(scene):
        return ReferenceLight(np.reshape(scene.karf.chart, (3, 3)).astype(np.float64))
    card = np.array(scene.karf.card)
    if not card.any():
        return None
    try:
        return ReferenceLight.of_card(card)
    except BadRequest:  # the panel says that the card is too dark or clipped
        return None


def has_chart(scene: bpy.types.Scene) -> bool:
    """Tell whether a color chart was picked."""
    return any(scene.karf.chart)


def set_chart(scene: bpy.types.Scene, matrix: np.ndarray, left: float) -> None:
    """Remember the light by a color chart: a matrix [3, 3], and the mean CIEDE2000 that it leaves."""
    scene.karf.chart = np.ravel(matrix)
    scene.karf.chart_left = left


def forget_chart(scene: bpy.types.Scene) -> None:
    """Forget the color chart: names are what photos show, or those of the gray card."""
    set_chart(scene, np.zeros((3, 3)), 0)


def as_named(scene: bpy.types.Scene, color: np.ndarray) -> np.ndarray:
    """Return a color of the photos, sRGB [3], under the reference light, in [0, 1]; the same without card and chart."""
    light = reference_light(scene)
    return np.clip(color if light is None else light.reference(color), 0, 1)


def as_photographed(scene: bpy.types.Scene, color: np.ndarray) -> np.ndarray:
    """Return a color of a book, sRGB [3] in [0, 1], as the photos would show it; the same without card and chart."""
    light = reference_light(scene)
    return color if light is None else light.photographed(color)
