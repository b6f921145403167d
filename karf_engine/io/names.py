"""Names of views and objects that become names of files. No name read from a file may lead out of a folder.

The rules are those of all systems together, so that a project can be moved to any of them.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from ..errors import DataError

LONGEST = 200  # bytes of a name as UTF-8: file systems hold 255, and endings and temporary names come on top
LONGEST_MADE = 170  # of one that is made here, to which a split and a number may be added
FORBIDDEN = re.compile(r'[\x00-\x1f\x7f<>:"/\\|?*\ud800-\udfff]')
# devices of Windows, in every folder and with every ending
RESERVED = re.compile(r"(con|prn|aux|nul|conin\$|conout\$|(com|lpt)[\d¹²³]) *(\..*)?", re.IGNORECASE)


def file_name(text: str) -> str:
    """A name that can be a file's on every system, as close to the text as possible.

    Examples:
        >>> file_name("IMG_0001"), file_name("a/b?"), file_name("NUL.png")
        ('IMG_0001', 'a_b_', '_NUL.png')
    """
    name = FORBIDDEN.sub("_", one_form(text))
    name = name.encode()[:LONGEST_MADE].decode(errors="ignore")
    if name.rstrip(". ") != name:  # Windows drops them
        name = name.rstrip(". ") + "_"
    return f"_{name}" if RESERVED.fullmatch(name) or not name else name


def one_form(name: str) -> str:
    """The name in the form that is the same on every system: macOS may write letters and accents one by one.

    Examples:
        >>> one_form("cafe\\u0301") == "caf\\u00e9"
        True
    """
    return unicodedata.normalize("NFC", name)


def folded(name: str) -> str:
    """What is equal for names that Windows or macOS take for one: in either case, in any Unicode form."""
    return unicodedata.normalize("NFC", one_form(name).casefold())


def known_as(name: str, names: Iterable[str]) -> str:
    """The one of these names that is the same in another Unicode form; the name itself where none is."""
    return next((known for known in names if one_form(known) == one_form(name)), name)


def is_file_name(value: Any) -> bool:
    """Whether a value is a text that can be a file's or folder's name on every system."""
    if not isinstance(value, str) or FORBIDDEN.search(value) or RESERVED.fullmatch(value):
        return False
    return 0 < len(value.encode()) <= LONGEST and value.rstrip(". ") == value


def check_name(value: Any, path: Path, what: str) -> str:
    """The value, once it can be the name of a file.

    Args:
        value: As read.
        path: Where it was found, for messages.
        what: What it names, for messages, such as `an object`.

    Raises:
        DataError: No file can have this name.
    """
    if not is_file_name(value):
        shown = repr(value) if len(repr(value)) < LONGEST else f"{repr(value)[:LONGEST]}.."
        raise DataError(
            f"{path} has {what} named {shown}, which cannot be the name of a file.",
            f'A name has 1 to {LONGEST} bytes, none of / \\ : * ? " < > | and no point or space at its end.',
        )
    return value


def check_names(values: Any, path: Path, what: str) -> list[str]:
    """The values as a list, once each can be the name of a file and none occurs twice; arguments as `check_name`.

    Raises:
        DataError: As `check_name`, and where the values are not a list or repeat.
    """
    if not isinstance(values, Iterable) or isinstance(values, str | dict):
        raise DataError(f"{path} has no list of names of {what}.", "Run the stage that writes it again.")
    names = [check_name(value, path, what) for value in values]
    if len(set(map(one_form, names))) < len(names):
        raise DataError(f"{path} has {what} twice by one name.", "Run the stage that writes it again.")
    return names


def same_but_for_case(names: Iterable[str]) -> tuple[str, str] | None:
    """The first two names that Windows and macOS take for one; None where there are none.

    Examples:
        >>> same_but_for_case(["pot", "mug", "Pot"])
        ('pot', 'Pot')
    """
    first: dict[str, str] = {}
    for name in names:
        if first.setdefault(folded(name), name) != name:
            return first[folded(name)], name
    return None
