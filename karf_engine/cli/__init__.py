"""The command line: one verb a function of the library, and `run` for a job folder (see wire)."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from ..errors import Cancelled
from .failing import as_karf_error, say, say_error
from .parser import make_parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; returns the process exit code."""
    if hasattr(sys.stdout, "reconfigure"):  # a console of Windows may not know a letter of a path
        sys.stdout.reconfigure(errors="backslashreplace")
    options = make_parser().parse_args(arguments)
    try:
        return options.action(options)
    except KeyboardInterrupt:
        say("\ncancelled; what was finished is kept.")
        return Cancelled.exit_code
    except Exception as raised:
        error = as_karf_error(raised)
        say_error(error)
        return error.exit_code
