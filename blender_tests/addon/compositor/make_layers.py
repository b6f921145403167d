"""Run by the engine's Python: writes layers of the fake engine's objects, and the engine's recoloring, to a folder.

layers/ gets photo_0.exr, exposed.exr (another exposure) and, with OpenColorIO, acescg.exr; truth.npz gets `coverage`
[2, 30, 40], `edited` [2, 3, 3], `recolored` and `exposed` [30, 40, 3].
"""

import importlib.util
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[3]))

from blender_tests.addon.fake_engine.__main__ import LEARNED
from karf_engine.export.layers import write_layers
from karf_engine.io.color_spaces import color_space
from karf_engine.palettes.compositing import delta_composite, stack_palettes
from karf_engine.palettes.palette import Palette
from karf_engine.recolor.frames import Layers

EDITED = {"lid": [[0, 0, 0], [0.9, 0.1, 0.6], [0.3, 1.4, 0.2]], "pot": [[0, 0, 0], [0.1, 0.3, 0.9], [0.9, 0.9, 0.5]]}
GAINS = 0.75, 1.0, 1.25

folder = Path(sys.argv[1])
random = np.random.default_rng(1)
base = random.integers(0, 256, (30, 40, 3), dtype=np.uint8)
shares = random.dirichlet(np.ones(3), (2, 30, 40)).transpose(0, 3, 1, 2)
ramp = np.linspace(0, 1, 40)[None, :] * np.linspace(0.5, 1, 30)[:, None]
coverage = np.stack([ramp, (1 - ramp) * (ramp > 0.25)]).astype(np.float16)
weights = (shares * coverage[:, None]).astype(np.float16)
palettes = tuple(Palette(name, np.array(colors, np.float32)) for name, colors in LEARNED.items())
layers = Layers(palettes, base, coverage, weights, ramp)
write_layers(folder / "layers" / "photo_0.exr", layers)
write_layers(folder / "layers" / "exposed.exr", replace(layers, gains=GAINS))
if importlib.util.find_spec("PyOpenColorIO"):
    write_layers(folder / "layers" / "acescg.exr", layers, color_space("ACEScg"))

arrays = [{name: np.array(colors) for name, colors in each.items()} for each in (LEARNED, EDITED)]
learned, edited = (stack_palettes(list(LEARNED), each) for each in arrays)
base, weights = base.astype(np.float32) / 255, weights.astype(np.float32)
recolored = delta_composite(base, weights, learned, edited)
exposed = delta_composite(base, weights, learned * np.float32(GAINS), edited * np.float32(GAINS))
coverage = coverage.astype(np.float32)
np.savez(folder / "truth.npz", coverage=coverage, edited=edited, recolored=recolored, exposed=exposed)
