"""Named color spaces of photos and layers: to the engine's sRGB and back, by OpenColorIO.

A space is one of a configuration: the user's file, or the one that comes with the library. The engine's sRGB is the space
that every configuration can be brought to, by OpenColorIO's own way between configurations. Both ways are computed in
float32 without its fast approximations: sRGB colors of 16 bits go to a space and back within a step.
"""

from __future__ import annotations

import difflib
import os
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import BadRequest, DataError, is_out_of_memory, missing_extra
from .limited import run_limited

SRGB = "srgb_rec709_scene"  # IEC 61966-2-1's curve and primaries, by the name that the Color Interop Forum gives it
BUILT_IN = "ocio://default"
VARIABLE = "OCIO"  # of the environment: the path of a configuration, as in other programs
EXTRA = "color"


@dataclass(frozen=True)
class ColorSpace:
    """A color space by its name.

    Attributes:
        name: Name or alias in the configuration.
        config: Absolute path of the configuration, or its `ocio://` address; empty for the one that comes with the library.
    """

    name: str
    config: str = ""

    def to_srgb(self, colors: np.ndarray) -> np.ndarray:
        """sRGB float32 [..., 3] of colors in this space; not clipped. Raises DataError where the space is no longer known."""
        return _through(_processor(self, True), colors)

    def from_srgb(self, colors: np.ndarray) -> np.ndarray:
        """The inverse of `to_srgb`."""
        return _through(_processor(self, False), colors)

    @property
    def interop_id(self) -> str:
        """What the Color Interop Forum calls the space; empty where its configuration does not say."""
        _check(self)
        return _config(self.config).getColorSpace(self.name).getInteropID()


def color_space(name: str, config: str | None = None) -> ColorSpace:
    """A space that is there.

    Args:
        name: Name or alias.
        config: The configuration's file, or its `ocio://` address. None: that of the environment variable OCIO, else the one
            of the library.

    Raises:
        MissingDependency: OpenColorIO is not installed.
        DataError: The configuration cannot be read.
        BadRequest: It has no such space, or the space has no way to sRGB.
    """
    place = os.environ.get(VARIABLE, "") if config is None else config
    found = ColorSpace(name, place if "://" in place or not place else str(Path(place).absolute()))
    _check(found)
    return found


@lru_cache(maxsize=8)
def _check(space: ColorSpace) -> None:
    """Raise what `color_space` does. A file, and the tables that it names, are tried in a child process."""
    if not space.config or "://" in space.config:
        _require(space)
    else:
        run_limited(try_configuration, Path(space.config), (), space.name)


def try_configuration(path: Path, name: str) -> dict[str, np.ndarray]:
    """What a child process does: read a configuration and make a space's ways. Raises as `color_space`; gives nothing."""
    _require(ColorSpace(name, str(path)))
    return {}


def _require(space: ColorSpace) -> None:
    known = _config(space.config)
    if known.getColorSpace(space.name) is None:
        names = [*known.getColorSpaceNames()]
        words = {word.lower(): each for each in names for word in (each, *known.getColorSpace(each).getAliases())}
        near = list(dict.fromkeys(words[word] for word in difflib.get_close_matches(space.name.lower(), words, 5, 0.4)))
        raise BadRequest(
            f"There is no color space {space.name!r:.200} in {_said(space.config)}.",
            f"Nearest: {', '.join(near)}." if near else f"It has {', '.join(names)}.",
        )
    for is_to_srgb in (True, False):
        _new_processor(space, is_to_srgb)


def _library() -> Any:
    try:
        import PyOpenColorIO
    except ImportError as error:
        if is_out_of_memory(error):
            raise
        raise missing_extra("opencolorio", EXTRA) from error
    return PyOpenColorIO


@lru_cache(maxsize=4)
def _config(place: str) -> Any:
    library = _library()
    place.encode()  # the library takes UTF-8 alone
    try:
        return library.Config.CreateFromFile(place or BUILT_IN)
    except (library.Exception, library.ExceptionMissingFile) as error:
        raise DataError(
            f"The color configuration {place} cannot be read: {str(error).strip():.300}",
            f"Give an OpenColorIO configuration (config.ocio), or unset the variable {VARIABLE}.",
        ) from error


@lru_cache(maxsize=8)
def _processor(space: ColorSpace, is_to_srgb: bool) -> Any:
    _check(space)
    return _new_processor(space, is_to_srgb)


def _new_processor(space: ColorSpace, is_to_srgb: bool) -> Any:
    library, config = _library(), _config(space.config)
    between = library.Config
    convert = between.GetProcessorToBuiltinColorSpace if is_to_srgb else between.GetProcessorFromBuiltinColorSpace
    try:
        processor = convert(config, space.name, SRGB) if is_to_srgb else convert(SRGB, config, space.name)
        depth = library.BIT_DEPTH_F32
        return processor.getOptimizedCPUProcessor(depth, depth, library.OPTIMIZATION_LOSSLESS)
    except (library.Exception, library.ExceptionMissingFile) as error:
        raise BadRequest(
            f"The color space {space.name!r:.200} of {_said(space.config)} has no way to sRGB: {str(error).strip():.300}",
            "Name another space, or a configuration with the roles aces_interchange and scene_linear.",
        ) from error


def _through(processor: Any, colors: np.ndarray) -> np.ndarray:
    result = np.array(colors, np.float32, order="C")  # which OpenColorIO changes in place
    processor.applyRGB(result.reshape(-1, 3))
    return result


def _said(config: str) -> str:
    return f"the color configuration {config}" if config else "OpenColorIO's built-in configuration"
