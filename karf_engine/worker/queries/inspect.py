"""The kind `inspect`: how good a capture is, before anything is learned of it."""

from __future__ import annotations

from typing import Any

from .options import needed
from .session import Session


def inspect(session: Session, options: dict[str, Any]) -> dict[str, Any]:
    """Advice about a capture.

    Args:
        session: Where the picture is written.
        options: `capture`; and `holdout` and `masks` where there are such, as of the command.

    Returns:
        `advice`, the sentence and the findings, see `Message.to_json`; `is_poor`; and `picture`, the path of the map of
        what to shoot more.

    Raises:
        KarfError: The capture or a mask cannot be read.
    """
    from ...capture.quality.drawing import draw_map
    from ...commands.inspect import look
    from ...commands.options import InspectOptions

    given = {name: options.get(name) for name in ("holdout", "masks")}
    advice = look(InspectOptions.from_json({"capture": needed(options, "capture", str), **given}))
    picture = session.file("more_photos.png")
    draw_map(picture, advice)
    messages = [each.to_json() for each in (advice.sentence, *advice.findings)]
    return {"advice": messages, "is_poor": advice.is_poor, "picture": str(picture)}
