"""What a query must say."""

from __future__ import annotations

from typing import Any, TypeVar

from ...errors import BadRequest

Value = TypeVar("Value")


def needed(options: dict[str, Any], name: str, kind: type[Value]) -> Value:
    """The option of this name. Raises BadRequest where there is none, or one of another type."""
    value = options.get(name)
    if type(value) is not kind:
        raise BadRequest(f"The option {name} = {value!r:.200} is not of type {kind.__name__}.", "Correct the query.")
    return value
