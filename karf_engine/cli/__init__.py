"""The command line: one verb a function of the library, and `run` for a job folder (see worker.protocol)."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence

from ..errors import Cancelled
from ..worker.failing import as_karf_error, say, say_error
from .parser import check_known, make_parser

UNREAD = 128 + 13  # the exit code of programs whose output nobody reads: that of SIGPIPE


def is_one_of_several() -> bool:
    """Whether torchrun has started this process beside others."""
    return "TORCHELASTIC_RUN_ID" in os.environ and int(os.environ["WORLD_SIZE"]) > 1


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; returns the process exit code."""
    if hasattr(sys.stdout, "reconfigure"):  # a console of Windows may not know a letter of a path
        sys.stdout.reconfigure(errors="backslashreplace")
    options, others = make_parser().parse_known_args(arguments)
    try:
        check_known(options, others)
        if is_one_of_several():
            from .together import run_together  # needs torch, without which `doctor` still has something to say

            return run_together(lambda: options.action(options))
        code = options.action(options)
        print(end="", flush=True)
        return code
    except KeyboardInterrupt:
        say("\ncancelled; what was finished is kept.")
        return Cancelled.exit_code
    except BrokenPipeError:  # who read standard output has gone, as `head` does
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # else Python complains at its end
        return UNREAD
    except Exception as raised:
        error = as_karf_error(raised)
        say_error(error)
        return error.exit_code
