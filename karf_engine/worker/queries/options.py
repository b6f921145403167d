"""Read the options of queries."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeVar

from ...errors import BadRequest
from ...io.arguments import check_choice
from ...palettes.edit_files import edit_from_json

if TYPE_CHECKING:
    from ...palettes.palette import Edit
    from ...recolor.model import Model

Value = TypeVar("Value")


def require_option(options: dict[str, Any], name: str, kind: type[Value]) -> Value:
    """Return the option of this name. Raises BadRequest where it is missing or of another type."""
    value = options.get(name)
    if type(value) is not kind:
        raise BadRequest(f"The option {name} = {value!r:.200} is not of type {kind.__name__}.", "Correct the query.")
    return value


def fades_of(options: dict[str, Any]) -> bool | None:
    """Return whether splats that no photo shows fade, by the option `unseen`: `faded` or `shown`.

    Returns:
        None without the option: the project's setting `render.unseen` counts.

    Raises:
        BadRequest: The option is another text.
    """
    unseen = options.get("unseen")
    if not unseen:
        return None
    check_choice("unseen", unseen, ("faded", "shown"))
    return unseen == "faded"


def edit_of(model: Model, content: Any) -> Edit | None:
    """Return the edit of a query; None before palettes are learned.

    Args:
        model: The learned project.
        content: As edit.json; None changes nothing.

    Raises:
        BadRequest: The content is not a dictionary.
        DataError: The edit does not fit the model's palettes.
    """
    if not model.palettes:
        return None
    if content is not None and not isinstance(content, dict):
        raise BadRequest(f"The option edit = {content!r:.200} is not of type dict.", "Correct the query.")
    return edit_from_json(content or {}, "the query", model.palettes, model.edit().compositing)
