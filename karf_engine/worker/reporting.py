"""Report failures: a sentence to the user, the traceback of an internal error to the log."""

from __future__ import annotations

import os
import sys
import traceback
from pathlib import Path

from ..errors import KarfError
from ..io.failures import translate_error


def as_karf_error(error: Exception) -> KarfError:
    """Convert an exception for the user; print the traceback of an internal error."""
    if (known := translate_error(error)) is not None:
        return known
    log("".join(traceback.format_exception(error)).rstrip())
    return KarfError("Internal error: {error!r}.", "Report it with its trace (of a job: in engine.log).", error=error)


def print_error(error: KarfError) -> None:
    """Print an error's sentence and hint to standard error."""
    log(f"error: {error.sentence}\n       {error.hint}".rstrip())


def log(text: str) -> None:
    """Print to standard error, or nowhere if that is a log on a full disk."""
    try:
        print(text, file=sys.stderr, flush=True)
    except OSError:
        # else the interpreter would try again at exit, and change the exit code
        sys.stderr = Path(os.devnull).open("w", encoding="utf-8")
