"""The ways from masks to labels of the surface, by the names of `segmentation.labels`.

A new one is a function from a `LabelProblem` to a `LabelledSurface`, and a call of `register_labels` or an entry point
`karf.labels` that is the function.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..compute.progress import Emit
from ..errors import BadRequest
from ..fields.protocol import Field
from ..io.arguments import check_choice, checked
from ..io.plugins import load_plugin, plugin_names
from ..project.settings import LABEL_KINDS
from ..project.volumes import Volume
from .constraints import Constraints
from .labels import LabelledSurface, label_surface, vote_on_surface
from .surface_points import SurfacePoints
from .votes import RayVotes

PLUGINS = "karf.labels"


@dataclass(frozen=True)
class LabelProblem:
    """What labels are found from.

    Attributes:
        scene_field: The frozen radiance field.
        objects: Names of the K objects.
        points: On the surface.
        votes: Of the rays that the points were merged from.
        constraints: Those of the points by corrections.
        volumes: That objects must be inside or outside of, by their names.
        rounds: Of an iterative solver, at least 1.
        random: The only source of random numbers.
        emit: Receives events.
    """

    scene_field: Field
    objects: list[str]
    points: SurfacePoints
    votes: RayVotes
    constraints: Constraints
    volumes: Mapping[str, Sequence[Volume]]
    rounds: int
    random: np.random.Generator
    emit: Emit


LabelSolver = Callable[[LabelProblem], LabelledSurface]

SOLVERS: dict[str, LabelSolver] = {}


@checked
def register_labels(name: str, solve: LabelSolver) -> None:
    """Make a way to labels known: to the setting `segmentation.labels`.

    Raises:
        TypeError: An argument is of another type.
        BadRequest: Another way has this name.
    """
    if SOLVERS.setdefault(name, solve) is not solve:
        raise BadRequest(f"There are other labels {name!r}.", "Choose another name.")
    if name not in LABEL_KINDS:
        LABEL_KINDS.append(name)


def solve_labels(name: str, problem: LabelProblem) -> LabelledSurface:
    """Labels of the surface.

    Raises:
        BadRequest: No way has this name.
        DataError: No point stands for any of the objects.
        MissingDependency: An installed package brings it, and cannot be loaded.
    """
    if name not in SOLVERS and name in plugin_names(PLUGINS):
        register_labels(name, load_plugin(PLUGINS, name))
    check_choice("segmentation.labels", name, tuple(SOLVERS))
    return SOLVERS[name](problem)


def _clean(problem: LabelProblem) -> LabelledSurface:
    own = problem
    return label_surface(
        own.scene_field,
        own.objects,
        own.points,
        own.votes,
        own.constraints,
        own.volumes,
        own.rounds,
        own.random,
        own.emit,
    )


def _votes(problem: LabelProblem) -> LabelledSurface:
    return vote_on_surface(problem.objects, problem.points, problem.votes, problem.constraints, problem.emit)


register_labels("surface", _clean)
register_labels("masks", _votes)
register_labels("votes", _votes)
