"""What is said where something fails: a sentence to the user, the trace of a fault to the log."""

from __future__ import annotations

import os
import sys
import traceback
from pathlib import Path

from ..errors import KarfError
from ..io.failures import known_failure


def as_karf_error(error: Exception) -> KarfError:
    """The error as the user gets it; of an internal one the trace is printed too."""
    if (known := known_failure(error)) is not None:
        return known
    say("".join(traceback.format_exception(error)).rstrip())
    return KarfError("Internal error: {error!r}.", "Report it with its trace (of a job: in engine.log).", error=error)


def say_error(error: KarfError) -> None:
    """Print an error's sentence and hint to standard error."""
    say(f"error: {error.sentence}\n       {error.hint}".rstrip())


def say(text: str) -> None:
    """Print to standard error; where that is a log on a full disk, the exit code must do."""
    try:
        print(text, file=sys.stderr, flush=True)
    except OSError:
        # else the interpreter would try again at its end, and change the exit code
        sys.stderr = Path(os.devnull).open("w", encoding="utf-8")
