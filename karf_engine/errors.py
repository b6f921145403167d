"""The one family of exceptions: what went wrong, in a sentence, and what the user can do about it."""

from __future__ import annotations

import sys

INSTALL_NAMES = {"PIL": "pillow", "cv2": "opencv-python-headless"}  # where pip's name is another
LONGEST = 1500  # letters of a sentence: what it quotes of a file may be without end


class KarfError(Exception):
    """Base of all errors that a user can act on.

    Attributes:
        code: A stable word for programs, of the class.
        exit_code: Of a process that ends by it, of the class.
        sentence: What went wrong; names the file and the value.
        hint: The remedy.

    Example:
        try:
            learn("garden", "masks", project="garden_karf")
        except KarfError as error:
            print(error.sentence, error.hint)
    """

    code = "internal"
    exit_code = 70

    def __init__(self, sentence: str, hint: str = "") -> None:
        sentence = sentence if len(sentence) <= LONGEST else f"{sentence[:LONGEST]} ..."
        super().__init__(f"{sentence} {hint}".strip())
        self.sentence = sentence
        self.hint = hint


class BadRequest(KarfError):
    """The command or request is wrong: unknown option, value out of range, stage called too early."""

    code = "request"
    exit_code = 2


class MissingDependency(KarfError):
    """A package or file that the engine needs is not installed."""

    code = "dependency"
    exit_code = 3


class DataError(KarfError):
    """A capture, mask, project or edit file is missing, damaged, contradicts another, or cannot be read or written."""

    code = "data"
    exit_code = 4


class OutOfMemory(KarfError):
    """The device ran out of memory even with the smallest batch."""

    code = "memory"
    exit_code = 5


class Cancelled(KarfError):
    """The user asked to stop; the last good state is kept."""

    code = "cancelled"
    exit_code = 6


class Diverged(KarfError):
    """Training produced a value that is not finite."""

    code = "diverged"
    exit_code = 7


ERROR_CLASSES = (BadRequest, MissingDependency, DataError, OutOfMemory, Cancelled, Diverged)


def error_from_code(code: str, sentence: str, hint: str = "") -> KarfError:
    """The error of the class with this code, rebuilt on the other side of a process boundary.

    Examples:
        >>> error_from_code("data", "a.png is empty.", "Copy it again.")
        DataError('a.png is empty. Copy it again.')
    """
    for error_class in ERROR_CLASSES:
        if error_class.code == code:
            return error_class(sentence, hint)
    return KarfError(sentence, hint)


def missing_package(name: str) -> MissingDependency:
    """The error for a package (by its import name) that this Python lacks."""
    return MissingDependency(
        f"The engine's Python ({sys.executable}) has no package {name!r}.",
        f"Install it there: {sys.executable} -m pip install {INSTALL_NAMES.get(name, name)}",
    )
