"""Judge a capture before learning."""

from __future__ import annotations

from collections.abc import Callable

from ..capture import open_capture
from ..capture.advice import Advice, advise, draw_map
from ..capture.capture import leave_out
from ..capture.inspection import inspect_capture
from ..compute.progress import Emit
from ..errors import DataError
from ..io.files import write_json
from .options import InspectOptions


def run(options: InspectOptions, emit: Emit, should_stop: Callable[[], bool]) -> Advice:
    """Inspect the capture, write OUT/inspection.json and OUT/more_photos.png, and return the advice."""
    del should_stop  # seconds at most
    if options.masks is not None and not options.masks.is_dir():
        raise DataError("{path} is no folder of masks.", "Give one, or none.", path=options.masks)
    capture = leave_out(open_capture(options.capture, holdout=options.holdout), options.without)
    advice = advise(inspect_capture(capture, options.masks))
    if options.out is not None:
        write_json(options.out / "inspection.json", advice.to_json())
        draw_map(options.out / "more_photos.png", advice)
        emit("artifact", kind="inspection", path=str(options.out))
    return advice
