"""Photos and ground truth of the present scene, by Cycles."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Collection
from pathlib import Path

import bpy
import imageio.v3 as iio
import numpy as np

from .cameras import View
from .files import write_json, write_labels, write_picture
from .materials import unlit

PIXEL_FILTER = 1.5  # width of Cycles' Blackman-Harris filter in photos, pixels
DEPTH_UNIT = 0.001
NO_DEPTH = 65535


def set_up_render(size: int, field_of_view: float, threads: int) -> None:
    """Set the camera and the render settings that all passes share: ``size`` pixels square, CPU, fixed seed."""
    scene = bpy.context.scene
    camera = bpy.data.cameras.new("camera")
    camera.angle = field_of_view
    scene.camera = bpy.data.objects.new("camera", camera)
    scene.collection.objects.link(scene.camera)
    render = scene.render
    render.engine = "CYCLES"
    render.resolution_x = render.resolution_y = size
    render.threads_mode, render.threads = "FIXED", threads
    scene.cycles.device = "CPU"
    scene.cycles.seed = 1
    scene.cycles.denoiser = "OPENIMAGEDENOISE"
    scene.view_settings.view_transform = "Standard"


def set_up_photo(samples: int) -> None:
    """Make the next renders photos: adaptive sampling up to ``samples``, denoised, 8-bit sRGB."""
    scene = bpy.context.scene
    scene.use_nodes = False
    scene.render.use_persistent_data = True
    layer = scene.view_layers[0]
    layer.use_pass_object_index = layer.use_pass_z = False
    layer.material_override = None
    scene.render.resolution_percentage = 100
    scene.cycles.max_bounces = 6
    scene.cycles.samples = samples
    scene.cycles.use_adaptive_sampling = True
    scene.cycles.adaptive_threshold = 0.02
    scene.cycles.use_denoising = True
    scene.cycles.filter_width = PIXEL_FILTER
    scene.render.image_settings.file_format = "PNG"
    scene.render.image_settings.color_mode = "RGBA" if scene.render.film_transparent else "RGB"


def set_up_truth(folder: Path) -> None:
    """Make the next renders ground truth: ids and depth as float EXR in ``folder``, a ray through each pixel's center."""
    scene = bpy.context.scene
    scene.render.use_persistent_data = True
    layer = scene.view_layers[0]
    layer.use_pass_object_index = layer.use_pass_z = True
    layer.material_override = unlit()
    scene.render.resolution_percentage = 100
    scene.cycles.max_bounces = 0
    scene.cycles.samples = 1
    scene.cycles.use_adaptive_sampling = False
    scene.cycles.use_denoising = False
    scene.cycles.filter_width = 0.01
    write_passes(folder, ("IndexOB", "Depth"))


def write_passes(folder: Path, names: Collection[str]) -> None:
    """Make the next renders write these passes as float EXR in ``folder``."""
    scene = bpy.context.scene
    scene.use_nodes = True
    tree = scene.node_tree
    tree.nodes.clear()
    layers = tree.nodes.new("CompositorNodeRLayers")
    tree.links.new(layers.outputs["Image"], tree.nodes.new("CompositorNodeComposite").inputs[0])
    for name in names:
        sink = tree.nodes.new("CompositorNodeOutputFile")
        sink.base_path = str(folder)
        sink.format.file_format = "OPEN_EXR"
        sink.format.color_mode = "RGB"
        sink.format.color_depth = "32"
        sink.file_slots[0].path = name
        tree.links.new(layers.outputs[name], sink.inputs[0])


def render_view(view: View, file: Path) -> float:
    """Render one view with the present settings into ``file`` and return the seconds it took."""
    scene = bpy.context.scene
    scene.camera.matrix_world = view.camera_to_world
    scene.render.filepath = str(file)
    start = time.perf_counter()
    bpy.ops.render.render(write_still=True)
    return time.perf_counter() - start


def render_photos(out: Path, views: list[View], samples: int, suffix: str = ".png") -> None:
    """Render ``out/<split>/<stem>`` for every view and print the mean time of one; with alpha if the film has it.

    The frame is the view's number: what moves in the scene moves from photo to photo.
    """
    set_up_photo(samples)
    seconds = []
    with tempfile.TemporaryDirectory() as folder:
        for view in views:
            bpy.context.scene.frame_set(view.number)
            raw = Path(folder) / "photo.png"
            seconds.append(render_view(view, raw))
            write_picture(out / view.split / f"{view.stem}{suffix}", iio.imread(raw))
    print(f"{out}: {len(seconds)} photos, {np.mean(seconds):.2f} s each", flush=True)


def render_truth(out: Path, views: list[View], names: dict[str, int]) -> None:
    """Render the label image of every view, and the depth image of every test view; ``names``: object name -> id."""
    write_json(out / "labels" / "names.json", names)
    with tempfile.TemporaryDirectory() as folder:
        set_up_truth(Path(folder))
        for view in views:
            file = f"{view.split}/{view.stem}.png"
            render_view(view, Path(folder) / "unused.png")
            ids = np.rint(read_pass(Path(folder), "IndexOB")).astype(np.uint8)
            depth = read_pass(Path(folder), "Depth")
            write_labels(out / "labels" / file, ids)
            if view.split == "test":
                steps = np.minimum(np.rint(depth / DEPTH_UNIT), NO_DEPTH).astype(np.uint16)
                write_picture(out / "depth" / file, steps)


def read_pass(folder: Path, name: str) -> np.ndarray:
    """Return the first channel of the pass that the compositor just wrote, (H, W) with the top row first."""
    file = next(folder.glob(f"{name}*.exr"))
    image = bpy.data.images.load(str(file))
    image.colorspace_settings.name = "Non-Color"
    width, height = image.size
    values = np.empty(width * height * image.channels, np.float32)
    image.pixels.foreach_get(values)
    bpy.data.images.remove(image)
    file.unlink()
    return values.reshape(height, width, -1)[::-1, :, 0]
