"""Keyframes and drivers of swatches, which follow their swatch to where new palettes have it.

Blender names an animated swatch by numbers, `karf.objects[0].swatches[1].color`. A curve whose swatch is gone is named
by the object and the learned color, `karf.objects["pot"].swatches["#c0221a"].color`: that leads nowhere, so it moves
nothing, and keeps its keys until such a swatch is back.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import bpy

from ..host import compat

PATH = re.compile(r'karf\.objects\[(?:(\d+)|"((?:[^"\\]|\\.)*)")\](?:\.swatches\[(?:(\d+)|"(#[0-9a-f]{6})")\])?(\.\w+)')


@dataclass(frozen=True)
class Curve:
    """A curve or driver of an object.

    Attributes:
        curve: Blender's own.
        object_name: The object that it animates.
        swatch: Its number, the learned color where it waits for one, or None where the curve is the object's own.
        tail: The end of its path: the animated property.
    """

    curve: bpy.types.FCurve
    object_name: str
    swatch: int | str | None
    tail: str


def of(scene: bpy.types.Scene) -> list[Curve]:
    """The curves and drivers of the scene's objects and swatches."""
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
    if number is not None:
        if int(number) >= len(names):
            return None
        name = names[int(number)]
    else:
        name = bpy.utils.unescape_identifier(name)
    return Curve(curve, name, int(swatch) if swatch else color, tail)


def copy_shared_action(scene: bpy.types.Scene) -> None:
    """Give the scene a copy of its action where other scenes use it too: a curve animates one scene's swatch only."""
    action = scene.animation_data.action if scene.animation_data else None
    others = (other.animation_data for other in bpy.data.scenes if other != scene)
    if action is not None and any(other and other.action == action for other in others):
        scene.animation_data.action = action.copy()


def move(curve: Curve, numbers: Mapping[str, int], swatch: int | str | None) -> None:
    """Let a curve animate another swatch of its object.

    Args:
        curve: The curve.
        numbers: The number of each object by its name.
        swatch: The swatch's number, a color to wait for, or None where the curve is the object's own.
    """
    number = numbers.get(curve.object_name)
    waits = number is None or isinstance(swatch, str)
    place = f'"{bpy.utils.escape_identifier(curve.object_name)}"' if waits else number
    inner = "" if swatch is None else f".swatches[{swatch}]" if isinstance(swatch, int) else f'.swatches["{swatch}"]'
    path = f"karf.objects[{place}]{inner}{curve.tail}"
    if curve.curve.data_path != path:
        curve.curve.data_path = path
