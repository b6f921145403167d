"""From one color pair to an edit: "this color of the object becomes that color".

Options: object, source, target (#rrggbb), rule (becomes | fewest), edit (EDIT.json to start from), out (EDIT.json).
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from ..errors import BadRequest
from ..locking import opened
from ..progress import Emit
from ..project.edit import edit_of
from ..wire import Request


def run(request: Request, emit: Emit, should_stop: Callable[[], bool]) -> None:
    """Solve the edit and write it; other objects keep what `edit` says of them."""
    del should_stop  # milliseconds
    project, options = opened(request.project), request.options
    project.require("palette")
    for name in ("object", "source", "target", "out"):
        if not options.get(name):
            raise BadRequest(f"The match was given no {name}.", "Give object, source color, target color and out.")
    edit = edit_of(project, options.get("edit"))
    rule = options.get("rule", "becomes")
    edit.becomes(options["object"], options["source"], options["target"], rule).save(options["out"])
    emit("artifact", kind="edit", path=str(Path(options["out"])))
