"""The registry of commands: the frozen dataclass of each one's options defines its parser, jobs and library function.

Imports only the standard library: Blender uses it too.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ...errors import BadRequest
from ...io.options import Options
from .capturing import ImportSplatOptions, InspectOptions, MarkOptions, PosesOptions
from .editing import (
    CalibrationOptions,
    ColorwaysOptions,
    ExportSplatOptions,
    FarmOptions,
    MatchOptions,
    PointsOptions,
    RenderOptions,
)
from .learning import (
    GeometryOptions,
    LearnOptions,
    PaletteOptions,
    RecoloringOptions,
    SegmentationOptions,
    SplatsOptions,
)

# by name, in the order of the workflow
COMMANDS: dict[str, type[Options]] = {
    kind.command: kind
    for kind in (
        PosesOptions,
        ImportSplatOptions,
        InspectOptions,
        MarkOptions,
        LearnOptions,
        GeometryOptions,
        SegmentationOptions,
        PaletteOptions,
        RecoloringOptions,
        SplatsOptions,
        MatchOptions,
        RenderOptions,
        ColorwaysOptions,
        PointsOptions,
        ExportSplatOptions,
        FarmOptions,
    )
}


def options_of_job(command: str, project: Path, values: Mapping[str, Any]) -> Options:
    """Return the options of a job's request.

    Args:
        command: The request's stage.
        project: The request's project; some commands have none.
        values: The request's options, JSON values.

    Raises:
        BadRequest: An option is unknown, missing, of another type or out of range.
    """
    if command not in COMMANDS:
        raise BadRequest(f"Unknown command {command!r:.200}.", f"Use one of: {', '.join(COMMANDS)}.")
    kind = COMMANDS[command]
    own = {"project": project} if "project" in kind.__dataclass_fields__ else {}
    return kind.from_json({**values, **own})


__all__ = [
    "COMMANDS",
    "CalibrationOptions",
    "ColorwaysOptions",
    "ExportSplatOptions",
    "FarmOptions",
    "GeometryOptions",
    "ImportSplatOptions",
    "InspectOptions",
    "LearnOptions",
    "MarkOptions",
    "MatchOptions",
    "PaletteOptions",
    "PointsOptions",
    "PosesOptions",
    "RecoloringOptions",
    "RenderOptions",
    "SegmentationOptions",
    "SplatsOptions",
    "options_of_job",
]
