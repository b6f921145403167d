"""From a request to the stages that it names: what the command line, a job's process and the library all go through."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from importlib import import_module
from typing import Any

from ..compute.progress import Emit
from ..errors import missing_package
from ..project import STAGE_ORDER
from ..wire import Request


def run_request(request: Request, emit: Emit, should_stop: Callable[[], bool], **in_memory: Any) -> None:
    """Run a request in this process; `all` is every stage that learns, in their order.

    Args:
        request: the stage, the project and the stage's options.
        emit: receives the events (see `wire`).
        should_stop: asked often; once it is true the stage ends with Cancelled.
        **in_memory: what the stage takes beside its request, where the caller has read it already.

    Raises:
        KarfError: as the stage does; MissingDependency where a package is missing.
    """
    request.check_options()
    for stage in STAGE_ORDER if request.stage == "all" else (request.stage,):
        try:
            module = import_module(f".{stage}", __package__)
        except ModuleNotFoundError as error:
            raise missing_package(error.name) from error
        module.run(replace(request, stage=stage), emit, should_stop, **in_memory)
