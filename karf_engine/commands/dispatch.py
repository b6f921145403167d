"""Run any command of the registry: the one way from the command line, the worker and the library to the commands."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Any

from ..compute.progress import Emit
from ..errors import missing_package
from ..io.options import Options
from ..project import Project
from .options import LearnOptions


def run_command(options: Options, emit: Emit, should_stop: Callable[[], bool], **in_memory: Any) -> Any:
    """Run the command of these options in this process; `all` runs every stage that learns, in order.

    Returns the advice of `inspect`, the path that `mark` or `farm` wrote, how many `erase` has left out, else None.

    Args:
        options: Their class selects the command.
        emit: Receives the events (see the worker's protocol).
        should_stop: Polled often; the command raises Cancelled once it returns true.
        **in_memory: Arguments of the first stage that the caller has in memory.
    """
    result = None
    for stage in options.stages() if isinstance(options, LearnOptions) else (options,):
        try:
            module = import_module(f".{stage.command.replace('-', '_')}", __package__)
        except ModuleNotFoundError as error:
            raise missing_package(str(error.name)) from error
        project, out = (getattr(stage, name, None) for name in ("project", "out"))
        if project and out:
            Project(project).check_inside(out)
        result = module.run(stage, emit, should_stop, **in_memory)
        in_memory = {}
    return result
