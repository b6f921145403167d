"""Convert between the engine's sRGB and named color spaces of an OpenColorIO configuration, the user's or the built-in one.

Conversions are computed in float32 without OpenColorIO's fast approximations, so that 16-bit sRGB survives a round trip to
within one step.
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

SRGB = "srgb_rec709_scene"  # Color Interop Forum name of the curve and primaries of IEC 61966-2-1
BUILT_IN = "ocio://default"
VARIABLE = "OCIO"  # environment variable with the path of a configuration
EXTRA = "color"


@dataclass(frozen=True)
class ColorSpace:
    """A color space of a configuration."""

    name: str  # name or alias in the configuration
    config: str = ""  # absolute path or `ocio://` address of the configuration; empty for the built-in one

    def to_srgb(self, colors: np.ndarray) -> np.ndarray:
        """Convert colors [..., 3] of this space to sRGB float32, not clipped. Raises what `color_space` raises."""
        return _apply(_processor(self, True), colors)

    def from_srgb(self, colors: np.ndarray) -> np.ndarray:
        """Convert sRGB to this space; the inverse of `to_srgb`."""
        return _apply(_processor(self, False), colors)

    @property
    def interop_id(self) -> str:
        """The Color Interop Forum's name of the space; empty if the configuration has none."""
        _check(self)
        return _config(self.config).getColorSpace(self.name).getInteropID()


def color_space(name: str, config: str | None = None) -> ColorSpace:
    """Find a color space by name or alias.

    `config` is the path or `ocio://` address of a configuration; None: that of the environment variable OCIO, else the
    built-in one. Raises MissingDependency without OpenColorIO, DataError if the configuration cannot be read, BadRequest if
    it has no such space or no conversion of it to sRGB.
    """
    place = os.environ.get(VARIABLE, "") if config is None else config
    space = ColorSpace(name, place if "://" in place or not place else str(Path(place).absolute()))
    _check(space)
    return space


@lru_cache(maxsize=8)
def _check(space: ColorSpace) -> None:
    """Raise what `color_space` raises; configuration files are first read in a limited child process."""
    if not space.config or "://" in space.config:
        _require(space)
    else:
        run_limited(load_configuration, Path(space.config), (), space.name)


def load_configuration(path: Path, name: str) -> dict[str, np.ndarray]:
    """Read a configuration and build the conversions of a space, in a child process. Raises what `color_space` raises."""
    _require(ColorSpace(name, str(path)))
    return {}


def _require(space: ColorSpace) -> None:
    config = _config(space.config)
    if config.getColorSpace(space.name) is None:
        names = [*config.getColorSpaceNames()]
        aliases = {alias.lower(): each for each in names for alias in (each, *config.getColorSpace(each).getAliases())}
        matches = difflib.get_close_matches(space.name.lower(), aliases, 5, 0.4)
        near = list(dict.fromkeys(aliases[alias] for alias in matches))
        raise BadRequest(
            f"There is no color space {space.name!r:.200} in {_describe(space.config)}.",
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
    place.encode()  # raises for paths that are not UTF-8, which the library cannot open
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
    try:
        if is_to_srgb:
            processor = library.Config.GetProcessorToBuiltinColorSpace(config, space.name, SRGB)
        else:
            processor = library.Config.GetProcessorFromBuiltinColorSpace(SRGB, config, space.name)
        depth = library.BIT_DEPTH_F32
        return processor.getOptimizedCPUProcessor(depth, depth, library.OPTIMIZATION_LOSSLESS)
    except (library.Exception, library.ExceptionMissingFile) as error:
        raise BadRequest(
            f"The color space {space.name!r:.200} of {_describe(space.config)} has no way to sRGB: {str(error).strip():.300}",
            "Name another space, or a configuration with the roles aces_interchange and scene_linear.",
        ) from error


def _apply(processor: Any, colors: np.ndarray) -> np.ndarray:
    result = np.array(colors, np.float32, order="C")  # a copy, converted in place
    processor.applyRGB(result.reshape(-1, 3))
    return result


def _describe(config: str) -> str:
    return f"the color configuration {config}" if config else "OpenColorIO's built-in configuration"
