"""The query `inspect`: advice about a capture before learning."""

from __future__ import annotations

from typing import Any

from .options import require_option
from .session import Session


def inspect(session: Session, options: dict[str, Any]) -> dict[str, Any]:
    """Return advice about a capture.

    Args:
        session: Provides the picture's path.
        options: `capture`; optionally `holdout` and `masks`, as of the command.

    Returns:
        `advice`, the sentence and the findings, see `Message.to_json`; `is_poor`; and `picture`, the path of a map of
        where more photos would help.

    Raises:
        KarfError: The capture or a mask cannot be read.
    """
    from ...capture.advice import draw_map
    from ...commands.inspect import run
    from ...commands.options import InspectOptions

    given = {name: options.get(name) for name in ("holdout", "masks")}
    capture = require_option(options, "capture", str)
    advice = run(InspectOptions.from_json({"capture": capture, **given}), lambda *_, **__: None, session.is_superseded)
    picture = session.file("more_photos.png")
    draw_map(picture, advice)
    messages = [each.to_json() for each in (advice.sentence, *advice.findings)]
    return {"advice": messages, "is_poor": advice.is_poor, "picture": str(picture)}
