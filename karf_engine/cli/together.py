"""Run a command in several processes of torchrun: rank 0 runs it, the others take part in learning the scene."""

from __future__ import annotations

import os
from collections.abc import Callable

from ..commands.geometry import help_to_learn
from ..compute.runtime import join, leave


def run_together(command: Callable[[], int]) -> int:
    """Run the command or help, and return the exit code. When one process fails, torchrun ends all."""
    process_group = join()
    if process_group.rank:
        help_to_learn(process_group)
        leave()
        os._exit(0)  # gloo's threads may still run, and would abort a normal exit
    if code := command():
        return code
    process_group.share(None)  # tells the others to end
    leave()
    return 0
