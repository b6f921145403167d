"""Nodes that follow the scene's swatches, where they were made of the same palettes."""

from collections.abc import Mapping, Sequence
from typing import Protocol

import bpy
import numpy as np

from .. import progress
from ..engine_api import Message
from ..nodes import drivers
from ..swatches import colors


class Palettes(Protocol):
    """What nodes were made of: an object's name and its palette as learned, [M, 3]."""

    name: str
    colors: np.ndarray


def known_of(scene: bpy.types.Scene, objects: Sequence[Palettes]) -> list[Palettes]:
    """Those whose palettes are the scene's."""
    return [each for each in objects if _fits(scene, each)]


def _fits(scene: bpy.types.Scene, each: Palettes) -> bool:
    item = scene.karf.objects.get(each.name)
    if item is None or len(each.colors) < colors.size(item):
        return False
    return colors.learned(item)[: len(each.colors)].tolist() == each.colors.tolist()


def edited(scene: bpy.types.Scene, known: Sequence[Palettes]) -> Mapping[str, np.ndarray]:
    """Palettes [M, 3] as the swatches stand, by the object's name."""
    return {each.name: colors.edited(scene.karf.objects[each.name])[: len(each.colors)] for each in known}


def follow(scene: bpy.types.Scene, node: bpy.types.Node, known: Sequence[Palettes]) -> None:
    """Let the node's sockets follow the scene's swatches from now on."""
    for each in known:
        for index in range(1, len(each.colors)):
            source = f'karf.objects["{bpy.utils.escape_identifier(each.name)}"].swatches[{index}]'
            drivers.drive(node, each.name, index, scene, source)


def say_others(scene: bpy.types.Scene, objects: Sequence[Palettes], what: str) -> None:
    """Warn of objects whose swatches in the scene are not those that `what` was made with."""
    others = [each.name for each in objects if each.name in scene.karf.objects and not _fits(scene, each)]
    if others:
        progress.warn(
            Message(
                "The swatches of {names} belong to other palettes than the {what}: the sockets start with the "
                "learned colors. Choose the project again in step 1 to load its palettes, then build again.",
                names=", ".join(others),
                what=what,
            )
        )
    fewer = [each.name for each in objects if _fits(scene, each) and len(each.colors) < len(_swatches(scene, each))]
    if fewer:
        progress.warn(
            Message(
                "The {what} lacks colors that were added to {names}: build again to include them.",
                names=", ".join(fewer),
                what=what,
            )
        )


def _swatches(scene: bpy.types.Scene, each: Palettes):
    return scene.karf.objects[each.name].swatches
