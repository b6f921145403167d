"""How good a capture is before it is learned: advice, and files of it where a folder is given."""

from __future__ import annotations

from ..capture import open_capture
from ..capture.quality.advice import Advice, advise
from ..capture.quality.drawing import draw_map
from ..capture.quality.inspection import inspect_capture
from ..errors import DataError
from ..io.files import write_json
from .options.capturing import InspectOptions


def look(options: InspectOptions) -> Advice:
    """Inspect the capture, write OUT/inspection.json and OUT/more_photos.png, and return what they say.

    Raises:
        DataError: It cannot be read, has too few photos, or there is no folder of masks.
    """
    if options.masks is not None and not options.masks.is_dir():
        raise DataError("{path} is no folder of masks.", "Give one, or none.", path=options.masks)
    advice = advise(inspect_capture(open_capture(options.capture, holdout=options.holdout), options.masks))
    if options.out is not None:
        write_json(options.out / "inspection.json", advice.to_json())
        draw_map(options.out / "more_photos.png", advice)
    return advice
