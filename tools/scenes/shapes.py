"""Surfaces: turned profiles, tubes and boxes."""

from __future__ import annotations

import math

import bpy
import numpy as np
from mathutils import Matrix, Vector


def smooth_curve(points, per_span: int = 8) -> np.ndarray:
    """Return the Catmull-Rom curve through ``points`` (N, D) as ((N - 1) * per_span + 1, D)."""
    points = np.asarray(points, float)
    padded = np.concatenate([2 * points[:1] - points[1:2], points, 2 * points[-1:] - points[-2:-1]])
    t = np.linspace(0.0, 1.0, per_span, endpoint=False)[:, None]
    spans = []
    for a, b, c, d in zip(padded[:-3], padded[1:-2], padded[2:-1], padded[3:], strict=True):
        bend = (2 * a - 5 * b + 4 * c - d) * t**2 + (3 * b - a - 3 * c + d) * t**3
        spans.append(0.5 * (2 * b + (c - a) * t + bend))
    return np.concatenate([*spans, points[-1:]])


def grid_object(name: str, grid: np.ndarray, made, object_id: int = 0):
    """Add the smooth surface of a vertex grid (rows, columns, 3) whose columns close on themselves."""
    rows, columns = grid.shape[:2]
    faces = [
        (i * columns + j, i * columns + (j + 1) % columns, (i + 1) * columns + (j + 1) % columns, (i + 1) * columns + j)
        for i in range(rows - 1)
        for j in range(columns)
    ]
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(grid.reshape(-1, 3).tolist(), [], faces)
    mesh.shade_smooth()
    mesh.materials.append(made)
    added = bpy.data.objects.new(name, mesh)
    added.pass_index = object_id
    bpy.context.scene.collection.objects.link(added)
    return added


def lathe(profile, ribs: int = 0, rib_depth: float = 0.0, columns: int = 96) -> np.ndarray:
    """Return the vertex grid of a profile of (radius, height) points turned about z, with optional vertical ribs."""
    curve = smooth_curve(profile)
    angle = np.linspace(0.0, 2.0 * math.pi, columns, endpoint=False)
    furrow = 1.0 - rib_depth * (1.0 - np.abs(np.sin(0.5 * ribs * angle))) ** 2
    radius = np.maximum(curve[:, :1], 1e-4) * furrow
    height = np.broadcast_to(curve[:, 1:], radius.shape)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), height], -1)


def tube(path, thickness, azimuth: float, columns: int = 24, flatness: float = 1.0) -> np.ndarray:
    """Return the vertex grid of a tube along a path of (radius, height) points in the vertical plane at ``azimuth``.

    ``thickness`` is one tube radius, or one per path point; ``flatness`` is that within the plane over that across it.
    """
    path = np.asarray(path, float)
    thick = np.broadcast_to(np.asarray(thickness, float), len(path))
    curve = smooth_curve(np.column_stack([path, thick]))
    tangent = np.gradient(curve[:, :2], axis=0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    outward = np.array([math.cos(azimuth), math.sin(azimuth), 0.0])
    sideways = np.array([-math.sin(azimuth), math.cos(azimuth), 0.0])
    up = np.array([0.0, 0.0, 1.0])
    center = curve[:, :1] * outward + curve[:, 1:2] * up
    normal = -tangent[:, 1:] * outward + tangent[:, :1] * up
    angle = np.linspace(0.0, 2.0 * math.pi, columns, endpoint=False)[:, None]
    ring = flatness * np.cos(angle) * normal[:, None] + np.sin(angle) * sideways
    body = center[:, None] + curve[:, 2][:, None, None] * ring
    caps = [np.repeat(center[i][None, None], columns, 1) for i in (0, -1)]
    return np.concatenate([caps[0], body, caps[1]])


def box(name: str, size, center, made):
    """Add a box with slightly rounded edges; ``size`` and ``center`` in scene units."""
    bpy.ops.mesh.primitive_cube_add(size=1.0)
    added = bpy.context.object
    added.name = name
    added.data.transform(Matrix.LocRotScale(Vector(center), None, Vector(size)))
    added.data.materials.append(made)
    bevel = added.modifiers.new("edges", "BEVEL")
    bevel.width, bevel.segments = 0.012, 3
    return added


def place(objects, x: float, y: float, z: float = 0.0, azimuth: float = 0.0) -> None:
    """Move objects built at the origin to (x, y, z), turned about z by ``azimuth`` radians."""
    for item in objects:
        item.matrix_world = Matrix.Translation((x, y, z)) @ Matrix.Rotation(azimuth, 4, "Z") @ item.matrix_world
