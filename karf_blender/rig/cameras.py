"""A capture as Blender cameras and points below one Empty, which is the capture's world and may be moved as a whole."""

import contextlib
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix, Vector

from ..engine_api import BadRequest, Capture, DataError, SparsePoints, View
from ..host import windows
from ..nodes import add, feed, shadeless_material
from ..pictures import photos
from ..project import disk, folders
from . import lens

POINTS_NAME = "KaRF points"
POINT_SIZE = 0.002  # radius of a sparse point, in units of the rig's extent
CLIP_START, CLIP_END = 0.001, 1000.0
ARBITRARY_WORLDS = ("llff", "colmap")  # formats without a known up axis
UP_WEIGHT = 0.01  # weight of the cameras' up axes, which decide if their right axes do not
LEAST_TURN = 1e-3  # mean squared sine of the angles between optical axes that meet in a point
FREE_NAME = "KaRF camera"
PICTURE = ("resolution_x", "resolution_y", "resolution_percentage", "pixel_aspect_x", "pixel_aspect_y")


@dataclass(frozen=True)
class Options:
    """How a capture is displayed; nothing here changes what is learned."""

    orientation: str = "auto"  # `file`, `upright` (+z is up), or `auto`: upright if the format's world is arbitrary
    size: float = 0.0  # extent of the cameras in Blender units; 0: as in the file
    points: bool = True  # whether to make the sparse points
    photos: bool = True  # whether to put photos behind the cameras
    camera_size: float = 0.025  # drawn size of a camera, in units of the rig's extent


def build(capture: Capture, name: str, scene: bpy.types.Scene, options: Options = Options()) -> bpy.types.Object:
    """Make an Empty with a camera for each view and the sparse points, in a new collection, and return the Empty.

    The cube of a new file is removed. If a camera cannot be made, the scene stays the same.
    """
    cube, extent = _untouched_cube(scene), extent_of(capture)
    matrix = Matrix(world_matrix(capture, options.orientation, options.size).tolist())
    size = extent * matrix.to_scale().x  # cameras are drawn and clipped in the units of Blender's world
    collection = bpy.data.collections.new(name)
    empty = bpy.data.objects.new(name, None)
    made = [empty]
    try:
        empty.matrix_basis = matrix
        empty.empty_display_size = 0.1 * extent
        images = _images_by_path()
        for view in capture.views:
            made.append(_camera(view, empty, size, options, images))
        if options.points and capture.points is not None:
            made.append(build_points(capture.points, empty, POINT_SIZE * extent))
    except Exception:
        for item in made:
            bpy.data.objects.remove(item)
        bpy.data.collections.remove(collection)
        raise
    for item in made:
        collection.objects.link(item)
    scene.collection.children.link(collection)
    if cube is not None:
        bpy.data.meshes.remove(cube.data)  # removes the object too
    return empty


def _camera(
    view: View, parent: bpy.types.Object, size: float, options: Options, images: dict[Path, bpy.types.Image]
) -> bpy.types.Object:
    data = bpy.data.cameras.new(view.name)
    lens.set_lens(data, view.camera)
    data.display_size = options.camera_size * size
    data.clip_start, data.clip_end = CLIP_START * size, CLIP_END * size
    data.show_background_images = options.photos
    if options.photos and view.image is not None and view.image.exists():
        with contextlib.suppress(DataError):  # reported when the user views through the camera
            if photos.is_shown_as_stored(view):
                _set_background(data, _load(view.image, images))
    camera = bpy.data.objects.new(view.name, data)
    camera.karf_view = view.name
    camera.parent = parent
    camera.matrix_local = Matrix(view.camera.camera_to_world.tolist())
    _lock(camera)
    return camera


def _lock(camera: bpy.types.Object) -> None:
    """Keep a captured camera where its photo was taken."""
    camera.lock_location = camera.lock_rotation = camera.lock_scale = (True, True, True)


def _images_by_path() -> dict[Path, bpy.types.Image]:
    """Return the file's images; Blender's own search, `check_existing`, takes seconds for thousands of photos."""
    return {folders.absolute(each.filepath): each for each in bpy.data.images if each.filepath and not each.library}


def _load(photo: Path, images: dict[Path, bpy.types.Image]) -> bpy.types.Image:
    try:
        if photo not in images:
            images[photo] = bpy.data.images.load(folders.stored(photo))
        return images[photo]
    except RuntimeError as error:
        raise DataError("{path} cannot be read as an image.", "Check the file.", path=photo) from error


def _set_background(data: bpy.types.Camera, image: bpy.types.Image) -> None:
    background = data.background_images.new()
    background.image, background.alpha = image, 1.0
    background.frame_method, background.display_depth = "STRETCH", "BACK"


def is_new(scene: bpy.types.Scene) -> bool:
    """Tell whether nobody has set up a scene: it has a new file's objects, or none, and a new file's colors."""
    view = scene.view_settings
    are_default = view.view_transform == "AgX" and view.look == "None" and (view.exposure, view.gamma) == (0, 1)
    return are_default and scene.karf.rig is None and set(scene.objects.keys()) <= {"Camera", "Cube", "Light"}


def _untouched_cube(scene: bpy.types.Scene) -> bpy.types.Object | None:
    """Return the cube of a new file that nobody has worked in."""
    if bpy.data.filepath or set(scene.objects.keys()) != {"Camera", "Cube", "Light"}:
        return None
    cube = scene.objects["Cube"]
    if cube.type != "MESH" or cube.modifiers or cube.animation_data is not None or cube.data.users > 1:
        return None
    corners = {tuple(round(value, 4) for value in vertex.co) for vertex in cube.data.vertices}
    is_cube = len(corners) == 8 and all(abs(value) == 1 for corner in corners for value in corner)
    return cube if is_cube and cube.matrix_basis == Matrix() else None


def camera_of(scene: bpy.types.Scene, view: str) -> bpy.types.Object:
    """Return the rig's camera of a captured view. Raises BadRequest if it was deleted."""
    rig = scene.karf.rig
    for camera in rig.children if rig else ():
        if camera.karf_view == view:
            return camera
    raise BadRequest(
        "The scene {name!r} has no camera of the view {view!r}.",
        "Import the capture again.",
        name=scene.name,
        view=view,
    )


def lacks_background(scene: bpy.types.Scene, view: View) -> bool:
    """Return whether a view's camera should have its photo behind it, and has none."""
    data = camera_of(scene, view.name).data
    is_wanted = _camera_shows_photo(camera_of(scene, view.name)) and not data.background_images
    return is_wanted and view.image is not None and view.image.exists()


def add_background(scene: bpy.types.Scene, view: str, photo: Path) -> None:
    """Put a picture behind a view's camera. Raises DataError."""
    _set_background(camera_of(scene, view).data, _load(photo, _images_by_path()))


def _camera_shows_photo(camera: bpy.types.Object) -> bool:
    return camera.data.show_background_images or camera.karf_photo_hidden


def hide_photos(scene: bpy.types.Scene, are_hidden: bool) -> None:
    """Hide the photos behind the rig's cameras, or show again what this has hidden."""
    for camera in scene.karf.rig.children if scene.karf.rig else ():
        if camera.type != "CAMERA" or camera.library or camera.data.library:
            continue
        if are_hidden and camera.karf_view and camera.data.show_background_images:
            camera.karf_photo_hidden, camera.data.show_background_images = True, False
        elif camera.karf_photo_hidden and not are_hidden:
            camera.karf_photo_hidden, camera.data.show_background_images = False, True


# --- viewing through a camera --------------------------------------------------------------------------------------
def look_through(scene: bpy.types.Scene, view: View) -> None:
    """Make a view's camera the scene's, with its photo's picture; remember what the scene had before."""
    looking, camera = scene.karf.looking, camera_of(scene, view.name)
    if not looking.is_on:
        looking.is_on, looking.camera, looking.before = True, scene.camera, _picture(scene)
    _lock(camera)  # earlier versions did not
    scene.camera = camera
    lens.set_picture(scene, view.camera)
    looking.during = _picture(scene)
    hide_others(scene)


def leave(scene: bpy.types.Scene) -> None:
    """Restore camera and picture, except for what the user has changed since."""
    looking = scene.karf.looking
    if scene.camera is not None and scene.camera.karf_view:
        scene.camera = looking.camera
    if _picture(scene) == list(looking.during):
        for name, value in zip(PICTURE, looking.before, strict=True):
            setattr(scene.render, name, type(getattr(scene.render, name))(value))
    looking.is_on = False
    hide_others(scene)


def hide_others(scene: bpy.types.Scene) -> None:
    """Hide the rig's other cameras and its points while viewing, if the user wants that; else show what this has hidden."""
    looking, layer = scene.karf.looking, scene.view_layers[0]
    for item in scene.karf.rig.children if scene.karf.rig else ():
        if item.name not in layer.objects:
            continue
        is_unwanted = looking.is_on and looking.hides_others and item != scene.camera
        if is_unwanted and not item.hide_get(view_layer=layer):
            item.karf_hidden = True
            item.hide_set(True, view_layer=layer)
        elif item.karf_hidden and not is_unwanted:
            item.karf_hidden = False
            item.hide_set(False, view_layer=layer)


def _picture(scene: bpy.types.Scene) -> list[float]:
    return [float(getattr(scene.render, name)) for name in PICTURE]


# --- sparse points -------------------------------------------------------------------------------------------------
def build_points(points: SparsePoints, parent: bpy.types.Object, radius: float) -> bpy.types.Object:
    """Make vertices with `color` (sRGB bytes) and `error` (pixels), displayed as balls: without, they have no color."""
    mesh = bpy.data.meshes.new(POINTS_NAME)
    mesh.vertices.add(len(points))
    mesh.vertices.foreach_set("co", points.positions.astype(np.float32).ravel())
    colors = np.ones((len(points), 4), np.float32)
    colors[:, :3] = points.colors / np.float32(255)
    mesh.attributes.new("color", "BYTE_COLOR", "POINT").data.foreach_set("color_srgb", colors.ravel())
    mesh.attributes.new("error", "FLOAT", "POINT").data.foreach_set("value", points.errors.astype(np.float32))
    mesh.update()
    item = bpy.data.objects.new(POINTS_NAME, mesh)
    item.modifiers.new("Balls", "NODES").node_group = _balls(radius)
    item.parent = parent
    item.hide_render = True
    return item


def _balls(radius: float) -> bpy.types.NodeTree:
    group = bpy.data.node_groups.new(POINTS_NAME, "GeometryNodeTree")
    group.is_modifier = True
    group.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
    group.interface.new_socket("Radius", in_out="INPUT", socket_type="NodeSocketFloat").default_value = radius
    group.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    entry = add(group, "NodeGroupInput", (0, 0))
    sizes = {"Segments": 4, "Rings": 2, "Radius": entry.outputs["Radius"]}
    ball = add(group, "GeometryNodeMeshUVSphere", (1, 1), sizes)
    inputs = {"Points": entry.outputs["Geometry"], "Instance": ball.outputs["Mesh"]}
    instances = add(group, "GeometryNodeInstanceOnPoints", (2, 0), inputs)
    realized = add(group, "GeometryNodeRealizeInstances", (3, 0), [instances.outputs[0]])
    joined = add(group, "GeometryNodeJoinGeometry", (4, 0), [realized.outputs[0]])
    # only the vertices know which attribute is the active color; join them, then delete them: Blender draws them black
    feed(joined.inputs[0], entry.outputs["Geometry"])
    neighbors = add(group, "GeometryNodeInputMeshVertexNeighbors", (3, 1))
    is_bare = add(group, "FunctionNodeBooleanMath", (4, 1), [neighbors.outputs["Face Count"]], operation="NOT")
    inputs = {"Geometry": joined.outputs[0], "Selection": is_bare.outputs[0]}
    cleared = add(group, "GeometryNodeDeleteGeometry", (5, 0), inputs)
    inputs = {"Geometry": cleared.outputs[0], "Material": shadeless_material(POINTS_NAME, "color")}
    painted = add(group, "GeometryNodeSetMaterial", (6, 0), inputs)
    add(group, "NodeGroupOutput", (7, 0), [painted.outputs[0]])
    return group


# --- views of the scene --------------------------------------------------------------------------------------------
def add_free(scene: bpy.types.Scene, view_matrix: Matrix, viewport_lens: float) -> bpy.types.Object:
    """Make a camera that sees what a 3D View sees, the scene's camera; it keeps the lens of one looked through."""
    seen, matrix = scene.camera, view_matrix.inverted()
    is_through = seen is not None and np.allclose(seen.matrix_world.normalized(), matrix, atol=1e-4)
    data = seen.data.copy() if is_through else bpy.data.cameras.new(FREE_NAME)
    data.name = FREE_NAME
    data.background_images.clear()
    if not is_through:
        data.lens = viewport_lens / 2  # of a 3D View's sensor, twice as wide
    camera = bpy.data.objects.new(FREE_NAME, data)
    camera.matrix_world = matrix
    scene.collection.objects.link(camera)
    if scene.karf.looking.is_on:
        leave(scene)
    scene.camera = camera
    return camera


def turn_views_about_object(scene: bpy.types.Scene) -> None:
    """Make a scene's 3D Views orbit about the active object, where segmentation has found it; their pictures stay."""
    center = _center(scene)
    for area in windows.areas("VIEW_3D") if center is not None else ():
        if windows.window_of(area).scene == scene:
            _turn(area.spaces.active.region_3d, center)


def turn_about(view: bpy.types.RegionView3D, scene: bpy.types.Scene) -> None:
    """Make a 3D View orbit about the active object, else the point that the captured cameras face; its picture stays."""
    focus = _center(scene) or _focus(scene)
    if focus is not None:
        _turn(view, focus)


def _turn(view: bpy.types.RegionView3D, focus: Vector) -> None:
    """Make a 3D View orbit about the point in the middle of its picture that is nearest to a focus."""
    if view.view_perspective == "CAMERA":
        view.view_location = focus  # Blender takes its depth when the camera is left
        return
    back = view.view_rotation @ Vector((0, 0, 1))
    behind = (view.view_location - focus).dot(back)
    if view.view_perspective == "ORTHO":  # its distance is its scale
        view.view_location -= behind * back
    elif view.view_distance + behind > 0:
        view.view_distance, view.view_location = view.view_distance + behind, view.view_location - behind * back


def _center(scene: bpy.types.Scene) -> Vector | None:
    """Return the middle of the active object to mark, where segmentation has found it."""
    marking = scene.karf.marking
    if scene.karf.rig is None or not 0 <= marking.active < len(marking.objects):
        return None
    center = disk.read(scene).centers.get(marking.objects[marking.active].folder)
    return scene.karf.rig.matrix_world @ Vector(center) if center else None


def _focus(scene: bpy.types.Scene) -> Vector | None:
    """Return the point nearest to the optical axes of all captured cameras; None where they are almost parallel."""
    cameras = [camera for camera in scene.karf.rig.children if camera.karf_view] if scene.karf.rig else []
    poses = np.array([(scene.karf.rig.matrix_world @ camera.matrix_basis).normalized() for camera in cameras])
    if not len(poses):
        return None
    across = np.eye(3) - poses[:, :3, 2, None] * poses[:, None, :3, 2]  # a projection onto each picture's plane
    total = across.sum(0) / len(poses)
    if np.linalg.eigvalsh(total)[0] < LEAST_TURN:
        return None
    return Vector(np.linalg.solve(total, (across @ poses[:, :3, 3, None]).mean(0)[:, 0]))


# --- the capture's world in Blender's ------------------------------------------------------------------------------
def world_matrix(capture: Capture, orientation: str, size: float) -> np.ndarray:
    """Return the Empty's matrix [4, 4] float64 for these `Options`: a rotation times a uniform scale."""
    matrix = np.eye(4)
    is_arbitrary = capture.format in ARBITRARY_WORLDS or capture.splats is not None
    if orientation == "upright" or (orientation == "auto" and is_arbitrary):
        matrix[:3, :3] = _turn_to_z(up_of(capture))
    if size:
        matrix[:3, :3] *= size / extent_of(capture)
    return matrix


def extent_of(capture: Capture) -> float:
    """Return the diagonal of the bounding box of all cameras in world units; 1 if they are all in one place."""
    positions = np.array([view.camera.position for view in capture.views])
    return float(np.linalg.norm(np.ptp(positions, axis=0))) or 1.0


def up_of(capture: Capture) -> np.ndarray:
    """Estimate up, [3] of length 1: perpendicular to the cameras' right axes, and near their up axes."""
    axes = np.array([view.camera.camera_to_world[:3, :3] for view in capture.views])
    right, up = axes[..., 0], axes[..., 1].mean(axis=0)
    found = np.linalg.solve(right.T @ right / len(right) + UP_WEIGHT * np.eye(3), up)
    length = np.linalg.norm(found)
    return found / length if length > 1e-6 else np.array([0.0, 0.0, 1.0])


def _turn_to_z(direction: np.ndarray) -> np.ndarray:
    """Return the smallest rotation [3, 3] from a direction [3] of length 1 to +z."""
    x, y, z = direction
    if z < -1 + 1e-9:
        return np.diag([1.0, -1.0, -1.0])
    cross = np.array([[0, 0, -x], [0, 0, -y], [x, y, 0]])  # of direction x +z, as a matrix
    return np.eye(3) + cross + cross @ cross / (1 + z)
