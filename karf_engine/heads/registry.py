"""Registry of heads: networks from encoded positions, prior features and directions to the logits of F_s or F_w.

Add a `Head` with `register_head`, or as an entry point `karf.heads` that is its builder.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Protocol

import torch
from torch import Tensor, nn

from ..errors import BadRequest
from ..io.arguments import check_arguments
from ..io.plugins import load_plugin, plugin_names
from ..kan.gated_block import GatedBlock, MLPHead, count_parameters
from ..project.settings import HEAD_KINDS, HeadSettings

MAX_WIDTH = 16384


class Head(Protocol):
    """An `nn.Module` from encodings and prior features to logits, differentiable with respect to its parameters."""

    def __call__(self, position_encoding: Tensor, features: Tensor, direction_encoding: Tensor | None = None) -> Tensor:
        """Return logits [n, n_out] of encoded positions [n, P], standardized features [n, F] and directions [n, D]."""
        ...


@dataclass(frozen=True)
class HeadSizes:
    """Input and output widths of a head."""

    n_position: int  # P, of the encoded positions
    n_direction: int  # D, of the encoded viewing directions; 0 without
    n_features: int  # F, number of prior features
    n_out: int  # number of logits


HeadBuilder = Callable[[HeadSizes, HeadSettings], Head]
PLUGINS = "karf.heads"
HEADS: dict[str, HeadBuilder] = {}


@check_arguments
def register_head(name: str, build: HeadBuilder) -> None:
    """Add a kind of head for the settings `segmentation.head` and `recoloring.head`; it should heed `width`.

    Raises BadRequest where another kind has this name.
    """
    if HEADS.setdefault(name, build) is not build:
        raise BadRequest(f"There is another kind of head {name!r}.", "Choose another name.")
    if name not in HEAD_KINDS:
        HEAD_KINDS.append(name)


def build_head(settings: HeadSettings, n_position: int, n_direction: int, n_features: int, n_out: int) -> Head:
    """Return a new head as the settings describe it; for the widths see `HeadSizes`.

    With `match="parameters"` its width is chosen so that the number of parameters is nearest to that of the full block
    of Gaussian layers of `settings.width`. Raises BadRequest where the kind of head or layer is not registered.
    """
    sizes = HeadSizes(n_position, n_direction, n_features, n_out)
    if settings.match == "parameters":
        full = replace(settings, head="kan", layer="grbf", variant="all")
        settings = replace(settings, width=_matched_width(settings, sizes, _n_parameters(full, sizes)))
    return _build(settings, sizes)


def _build(settings: HeadSettings, sizes: HeadSizes) -> Head:
    if settings.head not in HEADS and settings.head in plugin_names(PLUGINS):
        register_head(settings.head, load_plugin(PLUGINS, settings.head))
    if settings.head not in HEADS:
        raise BadRequest(f"The head '{settings.head}' is unknown.", f"Use one of {', '.join(HEADS)}.")
    return HEADS[settings.head](sizes, settings)


def _n_parameters(settings: HeadSettings, sizes: HeadSizes) -> int:
    with torch.device("meta"):  # shapes without memory
        head = _build(settings, sizes)
    assert isinstance(head, nn.Module)
    return count_parameters(head)


def _matched_width(settings: HeadSettings, sizes: HeadSizes, wanted: int) -> int:
    """Return the width whose number of parameters, which grows with the width, is nearest to `wanted`."""

    def count(width: int) -> int:
        return _n_parameters(replace(settings, width=width), sizes)

    above = bisect_left(range(MAX_WIDTH), wanted, lo=2, key=count)
    return min(above - 1, above, key=lambda width: abs(count(width) - wanted))


def _gated_block(sizes: HeadSizes, settings: HeadSettings) -> nn.Module:
    options = settings.layer, settings.variant, settings.centers, settings.bandwidth, settings.learn_bandwidth
    return GatedBlock(sizes.n_position, sizes.n_direction, sizes.n_features, sizes.n_out, settings.width, *options)


def _mlp_head(sizes: HeadSizes, settings: HeadSettings) -> nn.Module:
    return MLPHead(sizes.n_position, sizes.n_direction, sizes.n_features, sizes.n_out, settings.width)


register_head("kan", _gated_block)
register_head("mlp", _mlp_head)
