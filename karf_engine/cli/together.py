"""A command in several processes that torchrun has started: the first runs it, the others help it to learn the scene."""

from __future__ import annotations

import os
from collections.abc import Callable

from ..commands.geometry import help_to_learn
from ..compute.process_group import join, leave


def run_together(command: Callable[[], int]) -> int:
    """Run the command, or help; returns the exit code. Where one process fails, torchrun ends all."""
    process_group = join()
    if process_group.rank:
        help_to_learn(process_group)
        leave()
        os._exit(0)  # gloo's threads may still run, and abort a process that is taken down round them
    if code := command():
        return code
    process_group.share(None)  # there is nothing more to learn
    leave()
    return 0
