"""The kind `chart`: the light that a color chart in a photo tells, wherever in it the chart is."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from .options import needed
from .session import Session


def chart(session: Session, options: dict[str, Any]) -> dict[str, Any]:
    """What a chart in a photo says.

    Args:
        session: Not used.
        options: `photo`, the path of a picture file.

    Returns:
        `light`, the nine numbers of `ReferenceLight.matrix`, row by row; and `left`, `ChartFit.mean_left`.

    Raises:
        KarfError: The photo cannot be read, or no chart is seen in it, or it tells nothing.
    """
    from ...commands.calibration import read_chart

    fit = read_chart(Path(needed(options, "photo", str)), None)
    return {"light": fit.light.matrix.ravel().tolist(), "left": fit.mean_left}
