"""The command line: a verb for each command, and `run` for a job folder (see worker.protocol)."""

from __future__ import annotations

import io
import os
import sys
from collections.abc import Callable, Sequence

from ..errors import Cancelled
from ..io.failures import as_karf_error, log, print_error
from .verbs import check_known, make_parser

BROKEN_PIPE = 128 + 13  # the exit code of programs that SIGPIPE ends


def is_one_of_several() -> bool:
    """Return whether torchrun has started several processes."""
    return "TORCHELASTIC_RUN_ID" in os.environ and int(os.environ["WORLD_SIZE"]) > 1


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return the process exit code."""
    if isinstance(sys.stdout, io.TextIOWrapper):  # a Windows console may lack characters of a path
        sys.stdout.reconfigure(errors="backslashreplace")
    options, others = make_parser().parse_known_args(arguments)
    try:
        check_known(options, others)
        if is_one_of_several():
            return _run_together(lambda: options.action(options))
        code = options.action(options)
        print(end="", flush=True)
        return code
    except KeyboardInterrupt:
        log("\ncancelled; what was finished is kept.")
        return Cancelled.exit_code
    except BrokenPipeError:  # the reader of standard output has gone, as `head` does
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # else Python complains at exit
        return BROKEN_PIPE
    except Exception as raised:
        error = as_karf_error(raised)
        print_error(error)
        return error.exit_code


def _run_together(command: Callable[[], int]) -> int:
    """Run a command on rank 0, while the other processes of torchrun take part in learning the scene."""
    from ..commands.geometry import help_to_learn  # need torch, and `doctor` must run without it
    from ..compute.runtime import join, leave

    process_group = join()
    if process_group.rank:
        help_to_learn(process_group)
        leave()
        os._exit(0)  # gloo's threads may still run, and would abort a normal exit
    if code := command():  # torchrun then ends all processes
        return code
    process_group.share(None)  # tells the others to end
    leave()
    return 0
