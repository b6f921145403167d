"""What a render hands to Blender beside the picture: depth, the objects' masks, the swatches' weights."""

from collections.abc import Iterator
from dataclasses import dataclass

import bpy
import numpy as np
from bpy.props import BoolProperty

from .. import session
from ..nodes.sockets import swatch_socket
from ..swatches import colors

COMBINED, DEPTH, SEEN = "Combined", "Depth", "Seen"
FAR = 1e10  # depth where nothing is, as of Blender's own engines


def _tell_blender(_, context):
    # nodes of the compositor get a socket for each pass
    context.view_layer.update_render_passes()


class KARF_PG_layer(bpy.types.PropertyGroup):
    """What a view layer wants of KaRF beside Blender's own passes."""

    use_weights: BoolProperty(
        name="Weights",
        description="Add a pass for each swatch with its share in every pixel, from 0 to 1",
        update=_tell_blender,
    )
    use_seen: BoolProperty(
        name="Seen",
        description="Add a pass of how well the photos cover each pixel, from 0 (no photo) to 1. Requires splats",
        update=_tell_blender,
    )


@dataclass(frozen=True)
class Pass:
    """One pass of Blender's render result.

    Attributes:
        name: Of the pass.
        channels: A letter for each.
        kind: `COLOR` or `VALUE`.
        array: Of the engine's answer (see its query `show`).
        index: In the array.
    """

    name: str
    channels: str
    kind: str
    array: str
    index: tuple[int, ...] = ()


def beside_combined(scene: bpy.types.Scene, layer: bpy.types.ViewLayer) -> Iterator[Pass]:
    """What a view layer wants beside the picture."""
    if layer.use_pass_z:
        yield Pass(DEPTH, "Z", "VALUE", "depth")
    if layer.use_pass_cryptomatte_object:
        for level in range((layer.pass_cryptomatte_depth + 1) // 2):
            yield Pass(f"CryptoObject{level:02d}", "RGBA", "COLOR", "cryptomatte", (level,))
    if layer.karf.use_seen:
        yield Pass(SEEN, "X", "VALUE", "seen")
    if layer.karf.use_weights:
        for number, item in enumerate(scene.karf.objects):
            for index in range(1, colors.size(item)):
                yield Pass(swatch_socket(item.name, index), "X", "VALUE", "weights", (number, index))


def cryptomatte_name(layer: bpy.types.ViewLayer) -> str:
    """What Blender's Cryptomatte node looks for."""
    return f"{layer.name}.CryptoObject"


def pixels_of(each: Pass, arrays: dict[str, np.ndarray], to_blender: float) -> np.ndarray:
    """A pass's pixels, [H, W, channels] float32; zeros where the engine has nothing for it.

    Args:
        each: Not the picture itself.
        arrays: Of the engine's answer.
        to_blender: Blender units of a unit of the capture.
    """
    array = arrays[each.array]
    if each.array == "depth":
        return np.where(array > 0, array * to_blender, FAR).astype(np.float32)[..., None]
    if any(index >= size for index, size in zip(each.index, array.shape, strict=False)):
        height, width = arrays["color"].shape[:2]
        return np.zeros((height, width, len(each.channels)), np.float32)
    found = array[each.index]
    return found if found.ndim == 3 else found[..., None]


@session.setup
def _layer_properties():
    bpy.types.ViewLayer.karf = bpy.props.PointerProperty(type=KARF_PG_layer)
    yield
    del bpy.types.ViewLayer.karf
