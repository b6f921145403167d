# %% [markdown]
# # Recolor a capture
#
# From photos with camera poses and one rough mask of each object to a recolored photo, and a recolored picture from a
# camera that never was: the whole of KaRF by its library, on the demo capture. Some four minutes on one processor core;
# a second run takes what is learned from the project's folder.
#
# The cells are plain Python: after `pip install .` run the file, or open it in an editor that knows `# %%`.
# `KARF_NOTEBOOK=small` makes all of it small, as in the tests: quick, and not pretty.

# %%
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
from PIL import Image

import karf_engine as karf

SMALL = os.environ.get("KARF_NOTEBOOK") == "small"
OUT = Path(os.environ.get("KARF_NOTEBOOK_OUT", "notebooks_out/recolor"))
DEMO = Path(__file__).resolve().parents[1] / "demo" if "__file__" in globals() else Path("demo")
FEW = [
    "geometry.long_side=64",
    'geometry.levels=[{"voxels": 32, "iterations": 80, "step": 1.0}, {"voxels": 48, "iterations": 80, "step": 0.75}]',
    "geometry.samples=16000",
    "geometry.features=6",
    "segmentation.iterations=60",
    "segmentation.batch=256",
    "segmentation.width=16",
    "segmentation.cache_long_side=64",
    "recoloring.iterations=40",
    "recoloring.batch=256",
    "recoloring.width=16",
]
OUT.mkdir(parents=True, exist_ok=True)


def shown(*pictures: np.ndarray) -> Image.Image:
    """Pictures [H, W, 3] (or masks [H, W]) side by side."""
    three = [np.broadcast_to(p[..., None], (*p.shape, 3)) if p.ndim == 2 else p for p in pictures]
    return Image.fromarray(np.rint(np.clip(np.hstack(three), 0, 1) * 255).astype(np.uint8))


# %% [markdown]
# ## The capture
# Any known format opens the same way; views carry their cameras. Those of the split `train` teach, `test` views do not.

# %%
capture = karf.open_capture(DEMO)
print(len(capture.split("train")), "photos to learn from,", len(capture.split("test")), "kept out")

# %% [markdown]
# ## Learning
# One call does it all: the radiance field, clean masks in every view, a palette for each object, and where in space
# which palette color is how strong. Each step is a function of its own too: `learn_geometry`, `segment`,
# `extract_palettes`, `learn_recoloring`.

# %%
karf.learn(
    capture,
    masks=DEMO / "coarse_masks" / "one",
    preset="demo",
    overrides=FEW if SMALL else [],
    project=OUT / "project",
    threads=1,
    progress=print,
)
model = karf.load(OUT / "project", device="cpu")
for palette in model.palettes:
    print(palette.name, [f"#{''.join(f'{round(255 * float(c)):02x}' for c in color)}" for color in palette.colors])

# %% [markdown]
# ## What was learned
# A held-out view: rendered, and the masks of its objects.

# %%
view = capture.split("test")[3]
frame = model.render_view(view)
picture = shown(frame.base, frame.color, *frame.masks)
picture.save(OUT / "learned.png")
picture

# %% [markdown]
# ## An edit
# `becomes` takes the color as an eyedropper reads it and the color that it shall be; the object's swatches follow, so that
# shading and highlights stay. `swatch` sets a single one. An edit is a value: it can be saved, read, and extended.

# %%
edit = model.edit().becomes("pot", "#b5302c", "#3059b8")
edit.save(OUT / "blue_pot.json")
edit = karf.read_edit(OUT / "blue_pot.json", model.palettes)
recolored = model.recolor(view, edit, size="learned")
picture = shown(frame.base, recolored)
picture.save(OUT / "recolored.png")
picture

# %% [markdown]
# All else is as it was: outside the pot not a bit has changed. `size="learned"` is the size of the pictures above; without
# it the photo comes back with all its pixels, and `model.photo_view(view)` keeps its bit depth as well.

# %%
pot = frame.probabilities[model.objects.index("pot")]
print(f"mean change inside the pot {np.abs(recolored - frame.base)[pot > 0.5].mean():.3f}, "
      f"largest where it is not {np.abs(recolored - frame.base)[pot == 0].max():.3f}")  # fmt: skip

# %% [markdown]
# ## A camera that never was
# Halfway between two held-out cameras: the rendering, recolored by the palette weights that F_w gives there.

# %%
first, second = (other.camera for other in capture.split("test")[3:5])
step = np.eye(4)
step[:3, 3] = 0.1 * (second.camera_to_world - first.camera_to_world)[:3, 3]
camera = replace(first, camera_to_world=step @ first.camera_to_world)
side = max(1, round(camera.width * min(1, model.settings.geometry.long_side / camera.width)))
between = model.render(camera.scaled(side, round(side * camera.height / camera.width)))
picture = shown(between.color, model.composite(between, edit))
picture.save(OUT / "new_camera.png")
picture
