"""The overlay of Image Editors on the photo to mark: masks as tints with outlines, clicks, the current gesture."""

from dataclasses import dataclass, field

import bpy
import gpu
import numpy as np
from gpu_extras.batch import batch_for_shader

from .. import session
from ..engine_api import srgb_to_linear
from ..host.drawing import draw_line
from . import mask_layers, objects, photo, proposals
from .mask_layers import Layer

LONGEST = 2048  # pixels of a texture's side: larger masks are reduced
IS, IS_NOT = (0.15, 0.85, 0.25), (0.95, 0.15, 0.1)  # colors of corrections and clicks
TINT, OUTLINE = 0.35, 2.0  # the marked object's fill (opacity) and outline (pixels of the screen)
OTHERS_TINT, OTHERS_OUTLINE = 0.18, 1.0
LINE = ((3.0, (0, 0, 0, 0.6)), (1.0, (1, 1, 1, 1)))  # widths and colors: visible on light and on dark
DOT = 6.0  # radius of a click, pixels of the screen
CIRCLE = np.stack([np.cos(angles := np.linspace(0, 2 * np.pi, 24, endpoint=False)), np.sin(angles)], -1)
QUAD = ((0, 0), (1, 0), (1, 1), (0, 0), (1, 1), (0, 1))

VERTEX = """
void main()
{
  place = pos;
  gl_Position = ModelViewProjectionMatrix * vec4(corner + pos * extent, 0.0, 1.0);
}
"""
FRAGMENT = """
bool crosses(float here, vec2 across)
{
  for (int n = 0; n < 8; n++) {
    float angle = float(n) * 0.7853982;
    float near = texture(mask, place + across * vec2(cos(angle), sin(angle))).r;
    if ((near > 0.5) != (here > 0.5)) {
      return true;
    }
  }
  return false;
}

void main()
{
  vec2 pixel = vec2(dFdx(place.x), dFdy(place.y));
  float here = texture(mask, place).r;
  if (crosses(here, pixel * style.y)) {
    fragColor = vec4(color.rgb, 1.0);
  }
  else if (here <= 0.5 && crosses(here, pixel * (style.y + 1.5))) {
    fragColor = vec4(0.0, 0.0, 0.0, 0.5);
  }
  else {
    fragColor = vec4(color.rgb, here > 0.5 ? style.x : 0.0);
  }
}
"""


@dataclass
class _OnGpu:
    shader: gpu.types.GPUShader | None = None
    # by kind and object: a layer's version, and its pixels of one sign
    textures: dict[tuple[str, str], tuple[object, gpu.types.GPUTexture]] = field(default_factory=dict)


@session.draw_handler(bpy.types.SpaceImageEditor, "POST_PIXEL")
def _draw_overlay() -> None:
    context = bpy.context
    scene, space = context.scene, context.space_data
    layers = mask_layers.opened(scene)
    if layers is None or not photo.is_displayed(scene, space) or not space.overlay.show_overlays:
        return
    gpu.state.blend_set("ALPHA")
    used = {_draw_layer(context.region, *each) for each in _layers(scene, layers)}
    textures = session.get(_OnGpu).textures
    for key in textures.keys() - used:
        del textures[key]
    _draw_clicks(context.region, scene, layers)
    gesture = session.get(photo.Gesture).places
    if len(gesture) > 1:
        draw_line(gesture, *LINE)
    gpu.state.blend_set("NONE")


def _layers(scene, layers):
    """Yield from the lowest: key of the texture, layer, sign, color, opacity, width of the outline."""
    marking, active = scene.karf.marking, objects.active(scene)
    masks = layers.masks | layers.solved if marking.correct else layers.masks
    items = [item for item in marking.objects if item.folder in masks]
    for item in sorted(items, key=lambda item: item == active):
        style = (TINT, OUTLINE) if item == active else (OTHERS_TINT, OTHERS_OUTLINE)
        yield ("mask", item.folder), masks[item.folder], 1, objects.tint(item), *style
    if marking.correct and active is not None and active.folder in layers.corrections:
        layer = layers.corrections[active.folder]
        yield ("is", active.folder), layer, 1, IS, TINT, OTHERS_OUTLINE
        yield ("is not", active.folder), layer, -1, IS_NOT, TINT, OTHERS_OUTLINE


def _draw_layer(region, key, layer: Layer, sign: int, color, opacity: float, width: float):
    """Draw the pixels of a layer that have a sign over the photo of a region; return the key of their texture."""
    shader, view = _shader(), region.view2d
    low, high = (np.array(view.view_to_region(*place, clip=False), np.float32) for place in ((0, 0), (1, 1)))
    shader.bind()
    shader.uniform_sampler("mask", _texture(key, layer, sign))
    shader.uniform_float("corner", low)
    shader.uniform_float("extent", high - low)
    shader.uniform_float("color", (*srgb_to_linear(np.array(color)), 1.0))  # blended in linear light
    shader.uniform_float("style", (opacity, width * bpy.context.preferences.system.pixel_size))
    batch_for_shader(shader, "TRIS", {"pos": QUAD}).draw(shader)
    return key


def _texture(key, layer: Layer, sign: int) -> gpu.types.GPUTexture:
    textures = session.get(_OnGpu).textures
    if key not in textures or textures[key][0] != layer.version:
        step = -(-max(layer.pixels.shape) // LONGEST)
        pixels = np.ascontiguousarray(layer.pixels[::-step, ::step] == sign, np.float32)
        data = gpu.types.Buffer("FLOAT", pixels.size, pixels.ravel())
        textures[key] = layer.version, gpu.types.GPUTexture(pixels.shape[::-1], format="R8", data=data)
    return textures[key][1]


def _shader() -> gpu.types.GPUShader:
    state = session.get(_OnGpu)
    if state.shader is None:
        between = gpu.types.GPUStageInterfaceInfo("karf_mask")
        between.smooth("VEC2", "place")
        info = gpu.types.GPUShaderCreateInfo()
        info.push_constant("MAT4", "ModelViewProjectionMatrix")
        info.push_constant("VEC4", "color")
        for name in ("corner", "extent", "style"):
            info.push_constant("VEC2", name)
        info.sampler(0, "FLOAT_2D", "mask")
        info.vertex_in(0, "VEC2", "pos")
        info.vertex_out(between)
        info.fragment_out(0, "VEC4", "fragColor")
        info.vertex_source(VERTEX)
        info.fragment_source(FRAGMENT)
        state.shader = gpu.shader.create_from_info(info)
    return state.shader


def _draw_clicks(region, scene, layers) -> None:
    active = objects.active(scene)
    proposal = proposals.current(scene, active.folder) if active is not None else None
    if proposal is None:
        return
    width, height = layers.size

    def on_screen(x: float, y: float) -> tuple[float, float]:
        return region.view2d.view_to_region(x / width, 1 - y / height, clip=False)

    if proposal.box is not None:
        x0, y0, x1, y1 = proposal.box
        corners = ((x0, y0), (x1, y0), (x1, y1), (x0, y1), (x0, y0))
        draw_line([on_screen(*corner) for corner in corners], *LINE)
    for x, y, is_object in proposal.points:
        _draw_click(on_screen(x, y), is_object)


def _draw_click(place, is_object: bool) -> None:
    scale = bpy.context.preferences.system.ui_scale
    for radius, color in ((DOT + 1.5, (1, 1, 1)), (DOT, IS if is_object else IS_NOT)):
        rim = np.array(place) + radius * scale * CIRCLE
        _draw("TRIS", np.stack([np.broadcast_to(place, rim.shape), rim, np.roll(rim, 1, axis=0)], 1), (*color, 1))
    arm = DOT * 0.6 * scale
    for along in ((arm, 0), (0, arm))[: 1 + is_object]:
        _draw("LINES", np.array([np.subtract(place, along), np.add(place, along)]), (1, 1, 1, 1))


def _draw(kind: str, places: np.ndarray, color) -> None:
    shader = gpu.shader.from_builtin("UNIFORM_COLOR")
    shader.uniform_float("color", color)
    batch_for_shader(shader, kind, {"pos": [(x, y, 0) for x, y in places.reshape(-1, 2)]}).draw(shader)
