"""Real captures that others have published: held-out photos, and masks where the source has drawn some of every photo.

None may be passed on with this repository. Whoever wants the figures fetches them from their authors into
KARF_CAPTURES/<name>, an environment variable; without it this part is skipped.
"""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

import karf_engine as karf
from karf_engine.capture.training_images import load_views
from karf_engine.io.images import alpha_composite, read_mask
from karf_engine.metrics.images import psnr
from karf_engine.metrics.masks import iou

from .consistency import model_of
from .store import Store
from .table import Figures, Table

CAPTURES = {  # name -> where it is published, and the folder of the source's own masks
    "flower": ("LLFF, with NeRF (Mildenhall et al. 2019), photos of 504 pixels", None),
    "fruit": ("github.com/tusharparimi/fruit-NeRF", None),
    "bonsai": ("Mip-NeRF 360 (Barron et al. 2022), every second photo", None),
    "goldcape": ("github.com/vork/moldGoldCape, photos of 456 pixels", "masks_gt"),
}
PRESET, HOLDOUT = "fast", 8  # every eighth photo is held out


def captures_folder() -> Path | None:
    """Return the folder of the captures' folders, if there is one."""
    folder = os.environ.get("KARF_CAPTURES")
    return Path(folder) if folder else None


def real_table(store: Store) -> Table:
    """Measure voxels and splats in held-out photos, and masks where true ones are known."""
    folder = captures_folder()
    if folder is None:
        raise SystemExit("set KARF_CAPTURES to the folder of " + ", ".join(CAPTURES))
    rows = {}
    for name, (_, masks) in CAPTURES.items():

        def measure(out: Path, name: str = name, masks: str | None = masks) -> Figures:
            return measure_capture(folder / name, folder / name / masks if masks else None, out, store.threads)

        rows[name] = store.take(f"real/{name}", measure)
    return Table("capture", rows)


def measure_capture(folder: Path, masks: Path | None, out: Path, threads: int) -> Figures:
    """Learn a capture and return its figures."""
    capture, project = karf.open_capture(folder, holdout=HOLDOUT), out / "project"
    karf.learn_geometry(capture, project=project, preset=PRESET, threads=threads)
    karf.learn_splats(project, threads=threads)
    model = karf.load(project)
    images = load_views(model.capture.split("test"), model.settings.geometry.long_side)
    photos = [alpha_composite(image.color, image.alpha) for image in images]
    figures: dict[str, float] = {}
    for source, suffix in (("field", ""), ("splats", "_splats")):
        frames = [model_of(model, source).render(image.camera) for image in images]
        values = [psnr(frame.base, photo) for frame, photo in zip(frames, photos, strict=True)]
        figures |= {f"psnr{suffix}": float(np.mean(values)), f"psnr{suffix}_worst": float(np.min(values))}
    stages = model.project.state()["stages"]
    figures["seconds"] = float(stages["geometry"]["seconds"] + stages["splats"]["seconds"])
    return figures | ({"iou": iou_of_masks(project, masks, out, threads)} if masks else {})


def iou_of_masks(project: Path, masks: Path, out: Path, threads: int) -> float:
    """Return the mean IoU in held-out photos, percent, from the source's mask of one training photo of each object."""
    views = karf.load(project).capture
    for folder in masks.iterdir():
        view = views.split("train")[0]
        (out / "masks" / folder.name).mkdir(parents=True)
        (out / "masks" / folder.name / f"{view.stem}.png").write_bytes((folder / f"{view.stem}.png").read_bytes())
    karf.segment(project, out / "masks", threads=threads)
    model, found = karf.load(project), []
    for image in load_views(model.capture.split("test"), model.settings.geometry.long_side):
        frame = model_of(model, "field").render(image.camera)
        for number, name in enumerate(model.objects):
            mask = read_mask(masks / name / f"{image.view.stem}.png")
            rows, columns = (
                np.arange(n) * m // n for n, m in zip(frame.masks[number].shape, mask.shape[:2], strict=True)
            )
            found.append(iou(frame.masks[number], mask[np.ix_(rows, columns)]))
    return 100 * float(np.mean(found))
