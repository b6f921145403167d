"""Folders that two computers share, where each has its own path to them."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from ..errors import BadRequest, Message

ABSOLUTE = re.compile(r"/|[A-Za-z]:[\\/]|\\\\")  # on either kind of system
# what may come before a folder's path within a sentence: no part of a longer path, and no drive
START = r"(?<![^\s'\"(\[{<=,:;])(?<!\b[A-Za-z]:)"
END = r"(?=$|[\\/\s'\",:;)\]]|\.(?:\s|$))"  # what may follow a folder's path within a sentence


@dataclass(frozen=True)
class PathMap:
    """The paths of shared folders.

    Attributes:
        folders: Pairs: a folder's path for the caller, and its path here. Empty: paths are the same on both sides.
    """

    folders: tuple[tuple[str, str], ...] = ()

    @classmethod
    def of(cls, texts: Sequence[str]) -> PathMap:
        """The map of texts `CALLERS=OURS`, as the command line takes them.

        Raises:
            BadRequest: One has no `=`, or a path that is not absolute.
        """
        pairs = tuple(tuple(part.rstrip("/\\") or part for part in text.partition("=")[::2]) for text in texts)
        for text, pair in zip(texts, pairs, strict=True):
            if not all(ABSOLUTE.match(part) for part in pair):
                raise BadRequest(f"{text!r} is not a pair of folders.", "Give two whole paths: /mnt/film=/srv/film")
        return cls(pairs)

    def here(self, value: Any) -> Any:
        """A value of a caller's request, with its paths as they are here.

        Args:
            value: A text, which is a path where it begins as one; or a list or dictionary of values.

        Raises:
            BadRequest: A path lies in none of the folders.

        Examples:
            >>> PathMap.of(["Z:\\\\film=/srv/film"]).here(["z:\\\\film\\\\pots\\\\a.png", "#102030"])
            ['/srv/film/pots/a.png', '#102030']
        """
        if isinstance(value, list | dict):
            return _each(value, self.here)
        if not self.folders or not isinstance(value, str) or not ABSOLUTE.match(value):
            return value
        if (found := self.shared(value)) is not None:
            return found
        known = ", ".join(f"{theirs} (here {ours})" for theirs, ours in self.folders)
        raise BadRequest(f"{value} lies in no folder that both computers share: {known}.", "Move it there.")

    def shared(self, text: str) -> str | None:
        """A caller's path as it is here; None where the text is not a path in a shared folder."""
        for theirs, ours in self.folders:
            if re.match(_pattern(theirs), text):
                return ours + _separated(text[len(theirs) :], ours)
        return None

    def theirs(self, value: Any) -> Any:
        """A value of an event, with the paths that its texts name as the caller knows them.

        Examples:
            >>> PathMap.of(["/mnt/film=/srv/film"]).theirs("/srv/film/a.png is missing, not /srv/films.")
            '/mnt/film/a.png is missing, not /srv/films.'
        """
        if isinstance(value, list | dict):
            return _each(value, self.theirs)
        if isinstance(value, Message):
            return Message(self.theirs(str(value.key)), **_each(value.values, self.theirs))
        if isinstance(value, str) and self.folders:
            any_folder = "|".join(f"({_pattern(ours)})" for _, ours in self.folders)
            return re.sub(f"{START}(?:{any_folder})" + r"([^\s'\",:;)\]]*)", self._theirs, value)
        return value

    def _theirs(self, found: re.Match[str]) -> str:
        *folders, tail = found.groups()
        theirs = next(pair[0] for pair, folder in zip(self.folders, folders, strict=True) if folder is not None)
        return theirs + _separated(tail, theirs)


def _each(value: list | dict, change: Any) -> list | dict:
    if isinstance(value, dict):
        return {name: change(part) for name, part in value.items()}
    return [change(part) for part in value]


def _pattern(folder: str) -> str:
    """A folder's path at its end; drives and shares of Windows in any case and with either slash."""
    if folder.startswith("/"):
        return re.escape(folder) + END
    return r"(?i:" + r"[\\/]".join(map(re.escape, re.split(r"[\\/]", folder))) + ")" + END


def _separated(tail: str, folder: str) -> str:
    """The rest of a path with the separators of the folder that it now lies in."""
    return tail.replace("\\", "/") if folder.startswith("/") else tail.replace("/", "\\")
