"""Time and memory of the Gaussian layer against its floor and its rivals: python3 tools/dev.py bench kan.

All cases run interleaved in one process, 16,384 rows, 256 -> 256, N = 8, float32; the figures are medians. The floor
is the matrix products alone, on blocks that already exist: one forward, two backward. `fastkan` is the plain form
that stores every basis. Memory is the peak a forward and backward pass allocates on top of input and parameters.
"""

import os
from functools import partial
from itertools import accumulate

os.environ.setdefault("KINETO_LOG_LEVEL", "99")  # the memory profiler is talkative

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from karf_engine.kan.layers import BSplineLayer, GRBFLayer, MLPLayer

from .rows import Row, median_seconds

N_ROWS, N_IN, N_OUT, N_CENTERS = 16384, 256, 256, 8
# Ratios of times, forward and forward + backward: ours to the floor at most, the stored form to ours at least.
FLOOR_TARGETS, FASTKAN_TARGETS = (1.6, 1.4), (2.8, 2.3)


class FastKANForm(nn.Module):
    """The Gaussian layer as it is usually written: bases [n, n_in, N] in memory, one linear layer over them."""

    def __init__(self):
        super().__init__()
        self.norm = nn.LayerNorm(N_IN)
        self.centers = nn.Parameter(torch.linspace(-2, 2, N_CENTERS), requires_grad=False)
        self.spline = nn.Linear(N_IN * N_CENTERS, N_OUT, bias=False)
        self.base = nn.Linear(N_IN, N_OUT)

    def forward(self, x: Tensor) -> Tensor:
        """Return [n, n_out] for x [n, n_in]."""
        spacing = 4 / (N_CENTERS - 1)
        bases = torch.exp(-(((self.norm(x)[..., None] - self.centers) / spacing) ** 2))
        return self.spline(bases.flatten(1)) + self.base(F.silu(x))


class MatrixFloor(nn.Module):
    """Only the products any Gaussian layer contains, on ready blocks; the backward pass gives both gradients."""

    def __init__(self):
        super().__init__()
        n_blocks = N_IN * (N_CENTERS + 1)
        self.blocks = nn.Parameter(torch.randn(N_ROWS, n_blocks))
        self.linear = nn.Linear(n_blocks, N_OUT)

    def forward(self, x: Tensor) -> Tensor:
        """Return [n, n_out]; x is not read."""
        return self.linear(self.blocks)


def _forward(layer: nn.Module, x: Tensor) -> None:
    with torch.no_grad():
        layer(x)


def _forward_backward(layer: nn.Module, x: Tensor, upstream: Tensor) -> None:
    _clear_gradients(layer, x)
    layer(x).backward(upstream)


def _clear_gradients(layer: nn.Module, x: Tensor) -> None:
    layer.zero_grad()
    x.grad = None


def _peak_megabytes(layer: nn.Module, x: Tensor, upstream: Tensor) -> float:
    """Return the highest sum of live allocations of a forward and backward pass, from the profiler's memory events."""
    _clear_gradients(layer, x)  # before, so that freeing them does not count
    with torch.profiler.profile(activities=[torch.profiler.ProfilerActivity.CPU], profile_memory=True) as profile:
        _forward_backward(layer, x, upstream)
    events = [event for event in profile.profiler.kineto_results.events() if event.name() == "[memory]"]
    live = accumulate(event.nbytes() for event in sorted(events, key=lambda event: event.start_ns()))
    return max(live) / 2**20


def run(threads: int = 1, repeats: int = 5) -> list[Row]:
    """Return one row a case: median milliseconds, ratios to the floor, and peak memory in MB; sets torch's threads."""
    torch.set_num_threads(threads)
    torch.manual_seed(0)
    x, upstream = torch.randn(N_ROWS, N_IN, requires_grad=True), torch.randn(N_ROWS, N_OUT)
    layers = {
        "floor": MatrixFloor(),
        "grbf": GRBFLayer(N_IN, N_OUT, N_CENTERS),
        "fastkan": FastKANForm(),
        "bspline": BSplineLayer(N_IN, N_OUT),
        "mlp": MLPLayer(N_IN, N_OUT),
    }
    passes = {"forward": _forward, "both": partial(_forward_backward, upstream=upstream)}
    cases = {(name, way): partial(work, layer, x) for name, layer in layers.items() for way, work in passes.items()}
    seconds = median_seconds(cases, repeats)
    return [
        {
            "case": name,
            "forward_ms": round(1e3 * seconds[name, "forward"], 1),
            "forward_to_floor": round(seconds[name, "forward"] / seconds["floor", "forward"], 2),
            "forward_backward_ms": round(1e3 * seconds[name, "both"], 1),
            "forward_backward_to_floor": round(seconds[name, "both"] / seconds["floor", "both"], 2),
            "peak_mb": round(_peak_megabytes(layer, x, upstream)),
        }
        for name, layer in layers.items()
    ]


def print_ratios(rows: list[Row]) -> None:
    """Print the layer's ratios beside their targets."""
    by_case = {row["case"]: row for row in rows}
    ours, stored, spline = by_case["grbf"], by_case["fastkan"], by_case["bspline"]
    for name, floor, rival in zip(("forward", "forward_backward"), FLOOR_TARGETS, FASTKAN_TARGETS, strict=True):
        faster = stored[f"{name}_ms"] / ours[f"{name}_ms"]
        print(f"{name}: {ours[f'{name}_to_floor']:.2f}x the floor (target <= {floor}), "
              f"{faster:.2f}x faster than fastkan (target >= {rival})")  # fmt: skip
    faster = spline["forward_backward_ms"] / ours["forward_backward_ms"]
    print(f"forward_backward: {faster:.2f}x faster than bspline, a KAN's usual layer (grid 5, order 3)")
    memory = [other["peak_mb"] / ours["peak_mb"] for other in (stored, spline)]
    print(f"peak memory: 1/{memory[0]:.1f} of fastkan, 1/{memory[1]:.1f} of bspline")
