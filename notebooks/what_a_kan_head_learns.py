# %% [markdown]
# # What a KAN head learns
#
# KaRF puts small networks, its *heads*, on top of a frozen radiance field. They are made of Kolmogorov-Arnold layers: a
# function of one variable on every edge, which is learned, instead of a weight on every edge and one fixed function in
# every node. This notebook trains such a head by itself, on a shape whose truth is known, and looks at what it learned.
# It needs `karf_engine.kan` alone, and a minute on one processor core.
#
# The cells are plain Python: after `pip install .` run the file, or open it in an editor that knows `# %%`.
# `KARF_NOTEBOOK=small` makes all of it small, as in the tests.

# %%
import os
from pathlib import Path

import numpy as np
import torch
import torch.nn.functional as F
from PIL import Image, ImageDraw

from karf_engine.kan.gated_block import GatedBlock, count_parameters
from karf_engine.kan.grbf import grbf
from karf_engine.kan.inputs import positional_encoding
from karf_engine.kan.layers import GRBFLayer

SMALL = os.environ.get("KARF_NOTEBOOK") == "small"
OUT = Path(os.environ.get("KARF_NOTEBOOK_OUT", "notebooks_out/kan_head"))
OUT.mkdir(parents=True, exist_ok=True)
STEPS, BATCH, WIDTH, SIDE = (60, 256, 8, 32) if SMALL else (600, 1024, 32, 160)
OCTAVES, N_FEATURES, N_CLASSES = 4, 8, 3

# %% [markdown]
# ## A scene to segment
# Positions in a cube; class 1 is a ball, class 2 a checkered slab, class 0 all else. The field below the head also knows
# *prior features* of each place. Here they are smooth functions of it that do not give the classes away, and noise.

# %%
torch.manual_seed(0)
MIXING = torch.randn(3, N_FEATURES)


def classes_at(x: torch.Tensor) -> torch.Tensor:
    """The true class [n] at positions [n, 3]."""
    ball = (x - torch.tensor([-0.4, 0.1, 0.0])).norm(dim=-1) < 0.45
    checks = (torch.floor(x[:, 0] * 4) + torch.floor(x[:, 1] * 4)) % 2 == 0
    slab = (x[:, 0] > 0.15) & (x[:, 2].abs() < 0.6) & checks
    return torch.where(ball, 1, torch.where(slab, 2, 0))


def features_at(x: torch.Tensor) -> torch.Tensor:
    """Prior features [n, N_FEATURES]."""
    return torch.tanh(2 * x @ MIXING) + 0.1 * torch.randn(len(x), N_FEATURES)


def logits_of(head: GatedBlock, x: torch.Tensor) -> torch.Tensor:
    """What the head says at positions [n, 3]: logits [n, N_CLASSES]."""
    return head(positional_encoding(x, OCTAVES), features_at(x))


# %% [markdown]
# ## The gated block, and what its parts are worth
# Eq. 6 of the paper: a backbone of two layers, a gate, and a residual path, with the learned numbers alpha and beta.
# Layers are Gaussian (`grbf`), B-splines (`bspline`) or plain ones (`mlp`).


# %%
def learned(layer: str, width: int) -> tuple[GatedBlock, list[float]]:
    """A head of one kind of layer, and its loss at every step."""
    torch.manual_seed(1)
    head = GatedBlock(3 + 6 * OCTAVES, 0, N_FEATURES, N_CLASSES, width, layer)
    adam = torch.optim.Adam(head.parameters(), 3e-3)
    losses = []
    for _ in range(STEPS):
        x = 2 * torch.rand(BATCH, 3) - 1
        loss = F.cross_entropy(logits_of(head, x), classes_at(x))
        adam.zero_grad()
        loss.backward()
        adam.step()
        losses.append(float(loss.detach()))
    return head, losses


@torch.no_grad()
def accuracy(head: GatedBlock) -> float:
    """Share of fresh positions whose class the head finds."""
    x = 2 * torch.rand(4 * BATCH, 3) - 1
    return float((logits_of(head, x).argmax(-1) == classes_at(x)).float().mean())


heads, curves = {}, {}
for kind, width in {"grbf": WIDTH, "bspline": WIDTH, "mlp": 3 * WIDTH}.items():  # of about as many parameters
    heads[kind], curves[kind] = learned(kind, width)
    print(f"{kind:8} {count_parameters(heads[kind]):6} parameters, loss {np.mean(curves[kind][-20:]):.3f}, "
          f"accuracy {accuracy(heads[kind]):.3f}")  # fmt: skip


# %% [markdown]
# ## The shape it sees
# A slice through the middle of the cube: the truth, then each head's answer.


# %%
@torch.no_grad()
def slices() -> Image.Image:
    """The truth and each head's classes in the plane z = 0, side by side."""
    colors = np.array([[235, 235, 235], [181, 48, 44], [48, 89, 184]], np.uint8)
    line = torch.linspace(-1, 1, SIDE)
    y, x = torch.meshgrid(-line, line, indexing="ij")
    points = torch.stack([x, y, torch.zeros_like(x)], -1).reshape(-1, 3)
    answers = [classes_at(points), *(logits_of(head, points).argmax(-1) for head in heads.values())]
    return Image.fromarray(np.hstack([colors[answer.reshape(SIDE, SIDE).numpy()] for answer in answers]))


picture = slices()
picture.save(OUT / "slices.png")
picture

# %% [markdown]
# ## The functions on its edges
# A Gaussian layer sums, over its inputs i, functions of one variable: N Gaussians, weighted, and a SiLU. They can be read
# off and drawn. Here are those that the output layer put between the strongest hidden numbers and class 2: a plain
# network would have straight lines in their places.


# %%
@torch.no_grad()
def edge_functions(layer: GRBFLayer, output: int, u: torch.Tensor) -> torch.Tensor:
    """The learned function [n, n_in] of each input of a layer, at normalized inputs u [n]; its SiLU is left out."""
    weight = layer.weight[output].reshape(layer.n_centers + 1, -1)[:-1]  # the last block is the SiLU's
    columns = []
    for i in range(weight.shape[1]):
        spline = torch.cat([weight[:, i : i + 1].T, torch.zeros(1, 1)], 1)
        columns.append(grbf(u[:, None] * 0, u[:, None], spline, torch.zeros(1), layer.bandwidth(), layer.n_centers))
    return torch.cat(columns, 1)


def drawn(curves: np.ndarray, width: int = 480, height: int = 240) -> Image.Image:
    """Curves [n, m], each a color, in one frame."""
    image = Image.new("RGB", (width, height), "white")
    draw = ImageDraw.Draw(image)
    low, high = curves.min(), curves.max()
    x = np.linspace(0, width - 1, len(curves))
    for number, curve in enumerate(curves.T):
        y = (high - curve) / max(high - low, 1e-9) * (height - 1)
        draw.line(list(zip(x, y, strict=True)), fill=f"hsl({number * 360 // curves.shape[1]}, 70%, 45%)", width=2)
    return image


output_layer = heads["grbf"].head
u = torch.linspace(-2.5, 2.5, 121)
functions = edge_functions(output_layer, 2, u)
strongest = functions.std(0).argsort(descending=True)[:6]
curved = functions - (u[:, None] * (u @ functions / (u @ u))) - functions.mean(0)  # what no straight line explains
print(
    f"bandwidth {float(output_layer.bandwidth().detach()):.2f} of a spacing of {4 / (output_layer.n_centers - 1):.2f} at the start"
)
print(
    f"of the strongest edges' variance no line explains {float(curved[:, strongest].var() / functions[:, strongest].var()):.0%}"
)
picture = drawn(functions[:, strongest].numpy())
picture.save(OUT / "edges.png")
picture

# %% [markdown]
# ## The gate
# alpha says how much of the residual path enters, beta how sharply each hidden number is gated. They start at 0 and 1;
# what they became is what the head found the parts of Eq. 6 to be worth.

# %%
block = heads["grbf"]
share = float(torch.sigmoid(block.alpha.detach()))
beta = block.beta.detach()
print(f"residual share sigmoid(alpha) = {share:.2f}; beta from {float(beta.min()):.2f} to {float(beta.max()):.2f}")
