"""What queries say."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeVar

from ...errors import BadRequest
from ...io.arguments import check_choice
from ...palettes.edit_files import edit_from_json

if TYPE_CHECKING:
    from ...palettes.palette import Edit
    from ...recolor.model import Model

Value = TypeVar("Value")


def needed(options: dict[str, Any], name: str, kind: type[Value]) -> Value:
    """The option of this name. Raises BadRequest where there is none, or one of another type."""
    value = options.get(name)
    if type(value) is not kind:
        raise BadRequest(f"The option {name} = {value!r:.200} is not of type {kind.__name__}.", "Correct the query.")
    return value


def fade(model: Model, options: dict[str, Any]) -> None:
    """Let a model's splats show what no photo does as the option `unseen` says, `faded` or `shown`; by default as the project's
    setting `render.unseen`. Raises BadRequest for another option."""
    unseen = options.get("unseen") or model.settings.render.unseen
    check_choice("unseen", unseen, ("faded", "shown"))
    if model.splatted is not None:
        model.splatted.fades = unseen == "faded"


def edit_of(model: Model, content: Any) -> Edit | None:
    """The wanted edit, or one that changes nothing; None before palettes are learned.

    Args:
        model: What is learned.
        content: As edit.json; None: nothing is changed.

    Raises:
        BadRequest: The content is no dict.
        DataError: It is no edit of the model's palettes.
    """
    if model.recoloring is None:
        return None
    if content is not None and not isinstance(content, dict):
        raise BadRequest(f"The option edit = {content!r:.200} is not of type dict.", "Correct the query.")
    return edit_from_json(content or {}, "the query", model.palettes, model.edit().compositing)
