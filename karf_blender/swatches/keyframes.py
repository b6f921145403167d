"""Keyframes and drivers of swatches, which follow their swatch to where new palettes have it."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import bpy

from ..host import compat

# Blender's path is karf.objects[0].swatches[1].color; a curve whose swatch is gone keeps its keys, and moves nothing, at
# karf.objects["pot"].swatches["#c0221a"].color until such a swatch is back
PATH = re.compile(r'karf\.objects\[(?:(\d+)|"((?:[^"\\]|\\.)*)")\](?:\.swatches\[(?:(\d+)|"(#[0-9a-f]{6})")\])?(\.\w+)')


@dataclass(frozen=True)
class Curve:
    """A curve or driver of an object."""

    fcurve: bpy.types.FCurve
    object_name: str
    swatch: int | str | None  # its number, the learned color where it waits for one, None for the object's own
    tail: str  # the end of its path: the animated property


def of(scene: bpy.types.Scene) -> list[Curve]:
    """Return the curves and drivers of the scene's objects and swatches."""
    animation = scene.animation_data
    if animation is None:
        return []
    strips = [strip for track in animation.nla_tracks for strip in track.strips]
    curves = [curve for owner in (animation, *strips) for curve in compat.curves_of(owner)]
    unique = {curve.as_pointer(): curve for curve in (*curves, *animation.drivers)}
    names = scene.karf.objects.keys()
    return [found for curve in unique.values() if (found := _parsed(curve, names))]


def _parsed(curve: bpy.types.FCurve, names: Sequence[str]) -> Curve | None:
    match = PATH.fullmatch(curve.data_path)
    if match is None:
        return None
    number, name, swatch, color, tail = match.groups()
    if number is None:
        name = bpy.utils.unescape_identifier(name)
    elif int(number) < len(names):
        name = names[int(number)]
    else:
        return None
    return Curve(curve, name, int(swatch) if swatch else color, tail)


def copy_shared_action(scene: bpy.types.Scene) -> None:
    """Give the scene its own copy of an action that other scenes use too: a curve animates one scene's swatch."""
    action = scene.animation_data.action if scene.animation_data else None
    others = (other.animation_data for other in bpy.data.scenes if other != scene)
    if action is not None and any(other and other.action == action for other in others):
        scene.animation_data.action = action.copy()


def move(curve: Curve, numbers: Mapping[str, int], swatch: int | str | None) -> None:
    """Move a curve to another swatch of its object; see `Curve.swatch`. numbers: of the objects, by name."""
    number = numbers.get(curve.object_name)
    waits = number is None or isinstance(swatch, str)
    place = f'"{bpy.utils.escape_identifier(curve.object_name)}"' if waits else number
    inner = "" if swatch is None else f".swatches[{swatch}]" if isinstance(swatch, int) else f'.swatches["{swatch}"]'
    path = f"karf.objects[{place}]{inner}{curve.tail}"
    if curve.fcurve.data_path != path:
        curve.fcurve.data_path = path
