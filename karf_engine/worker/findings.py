"""Findings of the doctor, one line of JSON each, and the tested versions of Python and packages."""

from __future__ import annotations

import json
import re
from dataclasses import asdict, dataclass

from ..errors import INSTALL_NAMES, KarfError, error_from_code

OK, WARNING, ERROR = "ok", "warning", "error"
STATUSES = (OK, WARNING, ERROR)  # from good to bad
VERDICT = "engine"  # the name of the last finding, which summarizes the others


@dataclass(frozen=True)
class Finding:
    """The result of one check."""

    name: str  # a stable word for programs: torch, disk, geometry; engine for the last finding
    status: str  # ok, warning (it works, with a limit) or error (the engine cannot work)
    sentence: str
    remedy: str = ""  # optional packages have one even with the status ok
    command: str = ""  # for a terminal, if that is the remedy
    code: str = ""  # for an error, the KarfError.code of the resulting failure
    seconds: float | None = None  # duration of a timed check

    @property
    def exit_code(self) -> int:
        """The exit code of a process that ends with this finding."""
        return error_from_code(self.code, "").exit_code if self.status == ERROR else 0

    def to_line(self) -> str:
        """Return one line of JSON, without the line end."""
        return json.dumps(asdict(self))

    @property
    def lines(self) -> list[str]:
        """The sentence, and the remedy and command if any."""
        return [line for line in (self.sentence, self.remedy, self.command) if line]

    def to_text(self) -> str:
        """Return the finding for a terminal, with its remedy below it."""
        return f"{self.status:9}" + f"\n{'':9}".join(self.lines)

    @classmethod
    def from_line(cls, line: str) -> Finding:
        """Parse a line. Raises ValueError if it is not a finding."""
        try:
            finding = cls(**json.loads(line))
        except TypeError as error:  # not an object, or other keys
            raise ValueError(str(error)) from error
        if finding.status not in STATUSES:
            raise ValueError(f"{finding.status!r} is not a status of a finding")
        return finding


def error_finding(name: str, error: KarfError, seconds: float | None = None) -> Finding:
    """Convert an error to a finding."""
    return Finding(name, ERROR, error.sentence, error.hint, code=error.code, seconds=seconds)


@dataclass(frozen=True)
class Range:
    """A half-open range of versions."""

    lowest: str
    end: str

    def contains(self, version: str) -> bool:
        """Return whether a version is in the range, ignoring labels after its numbers."""
        return _numbers(self.lowest) <= _numbers(version) < _numbers(self.end)

    def __str__(self) -> str:
        return f"{self.lowest} to below {self.end}"


@dataclass(frozen=True)
class Package:
    """A package by its import name, and its tested versions."""

    name: str
    range: Range

    @property
    def pip(self) -> str:
        """The name of its distribution."""
        return INSTALL_NAMES.get(self.name, self.name)

    @property
    def requirement(self) -> str:
        """The requirement for pip."""
        return f"{self.pip}>={self.range.lowest},<{self.range.end}"


PYTHON = Range("3.11", "3.15")
REQUIRED = (
    Package("torch", Range("2.6", "3")),
    Package("numpy", Range("2.0.2", "3")),
    Package("scipy", Range("1.15.3", "2")),
    Package("safetensors", Range("0.4.5", "1")),
    Package("filelock", Range("4.2.11", "5")),
    Package("imageio", Range("2.36", "3")),
    Package("PIL", Range("11", "14")),
    Package("pillow_heif", Range("1.3", "2")),
    Package("cv2", Range("5.0.0.93", "6")),
    Package("OpenEXR", Range("3.4", "4")),
)
POSES = Package("pycolmap", Range("4.1", "5"))
FAST = Package("numba", Range("0.62", "1"))
GSPLAT = "gsplat==1.5.3"


def _numbers(version: str) -> tuple[int, ...]:
    """Return the leading numbers of a version without trailing zeros: 2.13.0+cpu is (2, 13)."""
    numbers = [int(part) for part in re.split(r"[^\d.]", version)[0].split(".") if part]
    while numbers and not numbers[-1]:
        numbers.pop()
    return tuple(numbers)
