"""The tested versions of Python and packages; a test compares them with pyproject.toml."""

from __future__ import annotations

import re
from dataclasses import dataclass

from ..errors import INSTALL_NAMES


@dataclass(frozen=True)
class Range:
    """A half-open range of versions.

    Examples:
        >>> Range("2.6", "3").contains("2.13.0+cpu"), Range("2.6", "3").contains("3.0.1")
        (True, False)
    """

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
    Package("cv2", Range("5.0.0.93", "6")),
    Package("OpenEXR", Range("3.4", "4")),
)
POSES = Package("pycolmap", Range("4.1", "5"))
FAST = Package("numba", Range("0.62", "1"))


def _numbers(version: str) -> tuple[int, ...]:
    """Return the leading numbers of a version without trailing zeros: 2.13.0+cpu is (2, 13)."""
    numbers = [int(part) for part in re.split(r"[^\d.]", version)[0].split(".") if part]
    while numbers and not numbers[-1]:
        numbers.pop()
    return tuple(numbers)
