"""The kinds of files of Gaussians, by the ends of their names."""

from __future__ import annotations

from pathlib import Path

from .splat_file import SplatFile


def read_splats(path: Path) -> SplatFile:
    """Read Gaussians of another program, of the kind that the content, else the name, tells."""
    raise NotImplementedError


def write_splats(path: Path, splats: SplatFile) -> None:
    """Write Gaussians atomically, as the kind that the name's end tells."""
    raise NotImplementedError
