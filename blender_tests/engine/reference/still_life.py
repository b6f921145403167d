"""A still life with known ground truth: a red ball and a blue block on a gray slab, ray-cast in closed form.

World: z up, everything within 1.1 of the origin. Matte shading by one lamp. Labels: 0 slab and background, 1 ball,
2 block.
"""

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from karf_engine.capture.camera import Camera

LAMP = np.array([0.4, -0.5, 0.77])
BALL_CENTER, BALL_RADIUS = np.array([-0.4, 0.0, 0.1]), 0.42
BOXES = {2: ((0.15, -0.35, -0.3), (0.75, 0.35, 0.25)), 0: ((-1.0, -0.8, -0.45), (1.0, 0.8, -0.3))}
COLORS = {0: (0.62, 0.6, 0.55), 1: (0.85, 0.15, 0.1), 2: (0.15, 0.3, 0.8)}
SUBPIXELS = 3


@dataclass(frozen=True)
class Photo:
    """color [H, W, 3], black where alpha [H, W] is 0; labels [H, W] of the pixel centers."""

    camera: Camera
    color: np.ndarray
    alpha: np.ndarray
    labels: np.ndarray


def camera_at(azimuth: float, elevation: float, size: int = 32, distance: float = 3.6) -> Camera:
    """A camera that looks at the origin from these angles in radians."""
    back = np.array([np.cos(azimuth) * np.cos(elevation), np.sin(azimuth) * np.cos(elevation), np.sin(elevation)])
    right = np.array([-np.sin(azimuth), np.cos(azimuth), 0.0])
    pose = np.eye(4)
    pose[:3, :3] = np.stack([right, np.cross(back, right), back], 1)
    pose[:3, 3] = distance * back
    return Camera(size, size, 1.35 * size, 1.35 * size, size / 2, size / 2, pose)


def cameras(count: int, size: int = 32) -> list[Camera]:
    """Cameras all around at three heights."""
    return [camera_at(2 * np.pi * i / count, (0.35, 0.75, 1.1)[i % 3], size) for i in range(count)]


def take_photo(camera: Camera, sky: bool = False) -> Photo:
    """Photograph the still life; with `sky` its background is a gradient and alpha is 1 everywhere."""
    offsets = (np.arange(SUBPIXELS) + 0.5) / SUBPIXELS - 0.5
    color, alpha = np.zeros((camera.height * camera.width, 3)), np.zeros(camera.height * camera.width)
    for dx in offsets:
        for dy in offsets:
            part, hit, _ = _trace(*camera.rays(camera.pixel_centers() + [dx, dy]), sky)
            color += part / SUBPIXELS**2
            alpha += hit / SUBPIXELS**2
    _, _, labels = _trace(*camera.rays(camera.pixel_centers()), sky)
    shape = (camera.height, camera.width)
    return Photo(camera, color.reshape(*shape, 3), alpha.reshape(shape), labels.reshape(shape))


def _trace(origins: np.ndarray, directions: np.ndarray, sky: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    directions = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    nearest, normals = _hit_ball(origins, directions)
    labels = np.ones(len(origins), int)
    for label, corners in BOXES.items():
        distance, box_normals = _hit_box(origins, directions, *np.array(corners))
        closer = distance < nearest
        nearest, labels = np.where(closer, distance, nearest), np.where(closer, label, labels)
        normals = np.where(closer[:, None], box_normals, normals)
    hit = np.isfinite(nearest)
    shade = 0.55 + 0.45 * np.clip(normals @ LAMP, 0, 1)
    color = np.array([COLORS[label] for label in range(3)])[labels] * (shade * hit)[:, None]
    if sky:
        color = np.where(hit[:, None], color, 0.5 + 0.4 * directions[:, [2, 0, 1]])
        return color, np.ones(len(origins)), labels * hit
    return color, hit.astype(float), labels * hit


def _hit_ball(origins: np.ndarray, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    offset = origins - BALL_CENTER
    half_b = (offset * directions).sum(1)
    discriminant = half_b**2 - (offset**2).sum(1) + BALL_RADIUS**2
    distance = np.where(discriminant > 0, -half_b - np.sqrt(np.maximum(discriminant, 0)), np.inf)
    normals = (offset + np.where(np.isfinite(distance), distance, 0)[:, None] * directions) / BALL_RADIUS
    return distance, normals


def _hit_box(origins, directions, low, high) -> tuple[np.ndarray, np.ndarray]:
    with np.errstate(divide="ignore"):
        first, second = (low - origins) / directions, (high - origins) / directions
    near, far = np.minimum(first, second), np.maximum(first, second)
    axis = near.argmax(1)
    hit = near.max(1) < far.min(1)
    normals = -np.sign(directions) * np.eye(3)[axis]
    return np.where(hit, near.max(1), np.inf), normals


def write_capture(folder: Path, n_train: int = 16, n_test: int = 2, size: int = 32) -> dict[str, Photo]:
    """Write a NeRF-synthetic capture on black with photos r_0.. of each split; returns the photos by split/stem."""
    from karf_engine.io.images import write_png

    photos = {f"train/r_{i}": take_photo(camera) for i, camera in enumerate(cameras(n_train, size))}
    for i in range(n_test):
        photos[f"test/r_{i}"] = take_photo(camera_at(0.2 + 2.1 * i, 0.6, size))
    for name, photo in photos.items():
        write_png(folder / f"{name}.png", photo.color)
    for split in ("train", "test"):
        poses = {name: photo.camera.camera_to_world for name, photo in photos.items() if name.startswith(split)}
        frames = [{"file_path": f"./{name}", "transform_matrix": pose.tolist()} for name, pose in poses.items()]
        content = {"camera_angle_x": 2 * np.arctan(0.5 / 1.35), "frames": frames}
        (folder / f"transforms_{split}.json").write_text(json.dumps(content))
    return photos


def write_masks(folder: Path, photos: dict[str, Photo], stems=("r_0", "r_8")) -> None:
    """Write rough masks {ball,block}/<stem>.png of training photos: the truth, grown by a pixel on one side."""
    from karf_engine.io.images import write_png

    for stem in stems:
        labels = photos[f"train/{stem}"].labels
        for label, name in ((1, "ball"), (2, "block")):
            mask = labels == label
            write_png(folder / name / f"{stem}.png", mask | np.roll(mask, 1, 1))
