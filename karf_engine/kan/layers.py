"""Registry of layers: modules from [..., n_in] to [..., n_out], by name.

Add a layer with `register_layer`, or as an entry point `karf.layers` that is its builder.
"""

from collections.abc import Callable
from dataclasses import dataclass

from torch import nn

from ..errors import BadRequest
from ..io.arguments import check_arguments, check_choice, check_fields, check_number
from ..io.plugins import load_plugin, plugin_names
from ..project.settings import LAYER_KINDS
from .bspline import BSplineLayer
from .grbf import MAX_CENTERS, GRBFLayer, resolve_bandwidth
from .mlp import MLPLayer


@dataclass(frozen=True)
class LayerOptions:
    """Options of a layer; each kind reads its own.

    Attributes:
        n_centers: N of Eq. 5, 2 to 8; for `grbf`.
        bandwidth: initial h of Eq. 5, see `resolve_bandwidth`; for `grbf`.
        learn_bandwidth: whether h is trained; for `grbf`.
        is_output: whether it is the last layer, without activation; for `mlp`.
    """

    n_centers: int = 8
    bandwidth: str | float = "eq5"
    learn_bandwidth: bool = True
    is_output: bool = False

    def __post_init__(self) -> None:
        check_fields(self)
        check_number("n_centers", self.n_centers, 2, MAX_CENTERS)
        resolve_bandwidth(self.bandwidth, self.n_centers)


LayerBuilder = Callable[[int, int, LayerOptions], nn.Module]  # of n_in, n_out and options

PLUGINS = "karf.layers"
LAYERS: dict[str, LayerBuilder] = {}


@check_arguments
def register_layer(name: str, build: LayerBuilder) -> None:
    """Add a kind of layer for `GatedBlock` and the settings `segmentation.layer` and `recoloring.layer`.

    Args:
        name: of the kind.
        build: returns a layer for n_in, n_out and options.

    Raises BadRequest where another kind has this name.

    Example:
        >>> register_layer("linear", lambda n_in, n_out, options: nn.Linear(n_in, n_out))  # doctest: +SKIP
        >>> block = GatedBlock(33, 0, 12, n_out=4, layer="linear")  # doctest: +SKIP
    """
    if not name or LAYERS.setdefault(name, build) is not build:
        raise BadRequest(f"There is another kind of layer {name!r}.", "Choose another name.")
    if name not in LAYER_KINDS:
        LAYER_KINDS.append(name)


def build_layer(kind: str, n_in: int, n_out: int, options: LayerOptions | None = None) -> nn.Module:
    """Return a new layer of a registered kind. Raises BadRequest for an unknown kind, or options that it refuses.

    Example:
        >>> build_layer("mlp", 3, 2, LayerOptions(is_output=True)).linear
        Linear(in_features=3, out_features=2, bias=True)
    """
    if kind not in LAYERS and kind in plugin_names(PLUGINS):
        register_layer(kind, load_plugin(PLUGINS, kind))
    check_choice("layer", kind, tuple(LAYERS))
    return LAYERS[kind](n_in, n_out, options or LayerOptions())


def _grbf(n_in: int, n_out: int, options: LayerOptions) -> nn.Module:
    return GRBFLayer(n_in, n_out, options.n_centers, options.bandwidth, options.learn_bandwidth)


register_layer("grbf", _grbf)
register_layer("bspline", lambda n_in, n_out, options: BSplineLayer(n_in, n_out))
register_layer("mlp", lambda n_in, n_out, options: MLPLayer(n_in, n_out, options.is_output))
