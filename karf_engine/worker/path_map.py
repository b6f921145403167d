"""Map the paths of folders that two computers share under different paths."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from ..errors import BadRequest, Message

ABSOLUTE = re.compile(r"/|[A-Za-z]:[\\/]|\\\\")  # POSIX or Windows
# lookbehind of a folder's path within a sentence: neither a longer path nor a drive
START = r"(?<![^\s'\"(\[{<=,:;])(?<!\b[A-Za-z]:)"
END = r"(?=$|[\\/\s'\",:;)\]]|\.(?:\s|$))"  # lookahead of the same


@dataclass(frozen=True)
class PathMap:
    """The paths of shared folders."""

    # (on the caller's side, on this one); empty if paths are the same on both
    folders: tuple[tuple[str, str], ...] = ()

    @classmethod
    def of(cls, texts: Sequence[str]) -> PathMap:
        """Parse texts `CALLERS=OURS`. Raises BadRequest if one has no `=`, or a path that is not absolute."""
        pairs = []
        for text in texts:
            theirs, _, ours = text.partition("=")
            if not ABSOLUTE.match(theirs) or not ABSOLUTE.match(ours):
                raise BadRequest(f"{text!r} is not a pair of folders.", "Give two whole paths: /mnt/film=/srv/film")
            pairs.append((theirs.rstrip("/\\") or theirs, ours.rstrip("/\\") or ours))
        return cls(tuple(pairs))

    def to_local(self, value: Any) -> Any:
        """Map absolute paths of a request, in lists and dictionaries too. Raises BadRequest if one is not in a shared folder."""
        if isinstance(value, list | dict):
            return _each(value, self.to_local)
        if not self.folders or not isinstance(value, str) or not ABSOLUTE.match(value):
            return value
        if (found := self.local_path(value)) is not None:
            return found
        known = ", ".join(f"{theirs} (here {ours})" for theirs, ours in self.folders)
        raise BadRequest(f"{value} lies in no folder that both computers share: {known}.", "Move it there.")

    def local_path(self, text: str) -> str | None:
        """Map one of the caller's paths to this side; return None for a text that is not in a shared folder."""
        for theirs, ours in self.folders:
            if re.match(_pattern(theirs), text):
                return ours + _separated(text[len(theirs) :], ours)
        return None

    def to_caller(self, value: Any) -> Any:
        """Map the paths within the texts of an event to the caller's side."""
        if isinstance(value, list | dict):
            return _each(value, self.to_caller)
        if isinstance(value, Message):
            return Message(
                self.to_caller(str(value.key)), **{name: self.to_caller(part) for name, part in value.values.items()}
            )
        if isinstance(value, str) and self.folders:
            any_folder = "|".join(f"({_pattern(ours)})" for _, ours in self.folders)
            return re.sub(f"{START}(?:{any_folder})" + r"([^\s'\",:;)\]]*)", self._replaced, value)
        return value

    def _replaced(self, found: re.Match[str]) -> str:
        *folders, tail = found.groups()
        theirs = next(pair[0] for pair, folder in zip(self.folders, folders, strict=True) if folder is not None)
        return theirs + _separated(tail, theirs)


def _each(value: list | dict, change: Any) -> list | dict:
    if isinstance(value, dict):
        return {name: change(part) for name, part in value.items()}
    return [change(part) for part in value]


def _pattern(folder: str) -> str:
    """Return the pattern of a folder's path; Windows paths match in any case and with either slash."""
    if folder.startswith("/"):
        return re.escape(folder) + END
    return r"(?i:" + r"[\\/]".join(map(re.escape, re.split(r"[\\/]", folder))) + ")" + END


def _separated(tail: str, folder: str) -> str:
    """Return the rest of a path with the separators of its folder."""
    return tail.replace("\\", "/") if folder.startswith("/") else tail.replace("/", "\\")
