"""From a command's options to the module that carries it out: what command line, worker and library all go through."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Any

from ..compute.progress import Emit
from ..errors import missing_package
from ..io.options import Options
from ..project import Project
from .options import LearnOptions


def run_command(options: Options, emit: Emit, should_stop: Callable[[], bool], **in_memory: Any) -> None:
    """Run a command in this process; `all` is every stage that learns, in their order.

    Args:
        options: What the command is given; its class says which command.
        emit: Receives the events (see the worker's protocol).
        should_stop: Asked often; once it is true the command ends with Cancelled.
        **in_memory: What the first stage takes beside its options, where the caller has read it already.

    Raises:
        KarfError: As the command does; MissingDependency where a package is missing; DataError where what is to be
            written lies in the project, and a link of it leads out.
    """
    for stage in options.stages() if isinstance(options, LearnOptions) else (options,):
        try:
            module = import_module(f".{stage.command.replace('-', '_')}", __package__)
        except ModuleNotFoundError as error:
            raise missing_package(error.name) from error
        if hasattr(stage, "project") and getattr(stage, "out", None):
            Project(stage.project).contained(stage.out)
        module.run(stage, emit, should_stop, **in_memory)
        in_memory = {}
