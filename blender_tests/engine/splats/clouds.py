"""Random clouds and single Gaussians in front of a camera."""

import numpy as np

from karf_engine.capture.camera import Camera
from karf_engine.splats.kernels.arrays import C0, CENTER, COLOR, LOG_SCALE, LOGIT, ROTATION

GROUPS = {
    "center": slice(CENTER, LOG_SCALE),
    "scales": slice(LOG_SCALE, ROTATION),
    "rotation": slice(ROTATION, LOGIT),
    "opacity": slice(LOGIT, COLOR),
    "color": slice(COLOR, COLOR + 3),
    "harmonics": slice(COLOR + 3, None),
}
BACKGROUND, NEAR = (0.2, 0.5, 0.9), 0.2


def camera_ahead(width: int = 40, height: int = 36, focal: float = 50.0) -> Camera:
    """A camera four units up the z axis that looks down it."""
    pose = np.eye(4)
    pose[2, 3] = 4
    return Camera(width, height, focal, focal, width / 2, height / 2, pose)


def cloud(count: int = 60, degree: int = 3, seed: int = 0) -> np.ndarray:
    """A float32 table of Gaussians of all shapes and opacities around the origin."""
    random = np.random.default_rng(seed)
    table = np.empty((count, COLOR + 3 * (degree + 1) ** 2), np.float32)
    table[:, GROUPS["center"]] = random.uniform(-1, 1, (count, 3))
    table[:, GROUPS["scales"]] = random.uniform(-4, -1.5, (count, 3))
    table[:, GROUPS["rotation"]] = random.normal(size=(count, 4))
    table[:, LOGIT] = random.uniform(-2, 1, count)
    table[:, COLOR:] = random.normal(0, 0.3, (count, table.shape[1] - COLOR))
    return table


def ball(center=(0.0, 0.0, 0.0), size=0.2, opacity=0.9, color=(1.0, 0.5, 0.25), degree: int = 0) -> np.ndarray:
    """A table row with one round Gaussian."""
    row = np.zeros(COLOR + 3 * (degree + 1) ** 2, np.float32)
    row[GROUPS["center"]], row[GROUPS["scales"]], row[ROTATION] = center, np.log(size), 1
    row[LOGIT] = np.log(opacity / (1 - opacity))
    row[GROUPS["color"]] = (np.array(color) - 0.5) / C0
    return row
