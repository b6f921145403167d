"""File names of views and objects, valid on every operating system. No name read from a file may leave its folder."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from ..errors import DataError

LONGEST = 200  # UTF-8 bytes; file systems allow 255, including suffixes
LONGEST_MADE = 170  # UTF-8 bytes of a name made by `file_name`, to which a split and a number may be added
FORBIDDEN = re.compile(r'[\x00-\x1f\x7f<>:"/\\|?*\ud800-\udfff]')
# Windows devices, which exist in every folder and with every suffix
RESERVED = re.compile(r"(con|prn|aux|nul|conin\$|conout\$|(com|lpt)[\d¹²³]) *(\..*)?", re.IGNORECASE)


def file_name(text: str) -> str:
    """Turn a text into a valid file name, changing as little as possible."""
    name = FORBIDDEN.sub("_", normalize_unicode(text))
    name = name.encode()[:LONGEST_MADE].decode(errors="ignore")
    if name.rstrip(". ") != name:  # Windows drops them
        name = name.rstrip(". ") + "_"
    return f"_{name}" if RESERVED.fullmatch(name) or not name else name


def normalize_unicode(name: str) -> str:
    """Normalize a name to NFC; macOS may decompose accents."""
    return unicodedata.normalize("NFC", name)


def case_folded(name: str) -> str:
    """Return a key that is equal for names that Windows or macOS consider the same."""
    return unicodedata.normalize("NFC", normalize_unicode(name).casefold())


def find_normalized(name: str, names: Iterable[str]) -> str:
    """Return the one of `names` that equals `name` up to Unicode form, else `name`."""
    return next((known for known in names if normalize_unicode(known) == normalize_unicode(name)), name)


def is_file_name(value: Any) -> bool:
    """Test whether a value is a string and a valid file name on every system."""
    if not isinstance(value, str) or FORBIDDEN.search(value) or RESERVED.fullmatch(value):
        return False
    return 0 < len(value.encode()) <= LONGEST and value.rstrip(". ") == value


def check_name(value: Any, path: Path, what: str) -> str:
    """Return a value if it is a valid file name, else raise DataError "`path` has `what` named ..."."""
    if not is_file_name(value):
        excerpt = repr(value) if len(repr(value)) < LONGEST else f"{repr(value)[:LONGEST]}.."
        raise DataError(
            f"{path} has {what} named {excerpt}, which cannot be the name of a file.",
            f'A name has 1 to {LONGEST} bytes, none of / \\ : * ? " < > | and no point or space at its end.',
        )
    return value


def check_names(values: Any, path: Path, what: str) -> list[str]:
    """Return a list of distinct, valid file names. Raises DataError as `check_name`, or if they are not a list or repeat."""
    if not isinstance(values, Iterable) or isinstance(values, str | dict):
        raise DataError(f"{path} has no list of names of {what}.", "Run the stage that writes it again.")
    names = [check_name(value, path, what) for value in values]
    if len(set(map(normalize_unicode, names))) < len(names):
        raise DataError(f"{path} has {what} twice by one name.", "Run the stage that writes it again.")
    return names


def first_case_collision(names: Iterable[str]) -> tuple[str, str] | None:
    """Return the first two names that differ in case or Unicode form only; None if there are none."""
    first: dict[str, str] = {}
    for name in names:
        if first.setdefault(case_folded(name), name) != name:
            return first[case_folded(name)], name
    return None
