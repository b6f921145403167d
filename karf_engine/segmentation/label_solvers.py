"""Registry of label solvers, by the names of the setting `segmentation.labels`.

A solver is a function from a `LabelProblem` to a `LabelledSurface`. Add one with `register_labels`, or as an entry point
`karf.labels` that is the function.
"""

from __future__ import annotations

from collections.abc import Callable

from ..errors import BadRequest
from ..io.arguments import check_arguments, check_choice
from ..io.plugins import load_plugin, plugin_names
from ..project.settings import LABEL_KINDS
from .labels import LabelledSurface, LabelProblem, label_surface, vote_on_surface

PLUGINS = "karf.labels"

LabelSolver = Callable[[LabelProblem], LabelledSurface]

SOLVERS: dict[str, LabelSolver] = {}


@check_arguments
def register_labels(name: str, solve: LabelSolver) -> None:
    """Add a solver under a name of the setting `segmentation.labels`.

    Raises BadRequest where another solver has this name.
    """
    if SOLVERS.setdefault(name, solve) is not solve:
        raise BadRequest(f"There are other labels {name!r}.", "Choose another name.")
    if name not in LABEL_KINDS:
        LABEL_KINDS.append(name)


def solve_labels(name: str, problem: LabelProblem) -> LabelledSurface:
    """Label the surface with the solver of this name.

    Raises:
        BadRequest: no solver has this name.
        DataError: no point belongs to any object.
        MissingDependency: the plugin with the solver cannot be loaded.
    """
    if name not in SOLVERS and name in plugin_names(PLUGINS):
        register_labels(name, load_plugin(PLUGINS, name))
    check_choice("segmentation.labels", name, tuple(SOLVERS))
    return SOLVERS[name](problem)


register_labels("surface", label_surface)
register_labels("masks", vote_on_surface)
register_labels("votes", vote_on_surface)
