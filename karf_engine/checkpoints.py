"""Learned tensors on disk: safetensors with their settings in the header. Data only; nothing in a file is ever run."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save_file
from torch import Tensor

from .errors import DataError
from .failures import is_out_of_memory
from .files import atomic_write

AGAIN = "Run the stage that writes it again."
DAMAGE = (
    ArithmeticError,
    AttributeError,
    LookupError,
    RuntimeError,
    TypeError,
    ValueError,
)  # by facts or tensors of it


def save_tensors(path: Path, tensors: dict[str, Tensor], schema: str, facts: dict[str, Any]) -> None:
    """Write tensors and JSON facts atomically; `schema` names what the file is and its version."""
    # one entry: safetensors writes several in any order, and equal results shall be equal bytes
    header = {"karf": json.dumps({"schema": schema, "facts": facts})}
    stored = {name: tensor.detach().cpu().contiguous() for name, tensor in tensors.items()}
    atomic_write(path, lambda temporary: save_file(stored, temporary, header))


def load_tensors(
    path: Path, schema: str, device: torch.device | str = "cpu"
) -> tuple[dict[str, Tensor], dict[str, Any]]:
    """Read tensors and facts. Raises DataError where the file is missing, damaged, of another schema, or not finite."""
    try:
        with safe_open(path, "pt") as stored:
            header = _header(stored.metadata() or {})
            found = header.get("schema")
            if found != schema:
                raise DataError(f"{path} holds {found!r:.200}, not {schema!r}.", AGAIN)
            tensors = {name: stored.get_tensor(name) for name in stored.keys()}
            facts = header["facts"]
    except FileNotFoundError as error:
        raise DataError(f"{path} does not exist.", "Run the stage that writes it.") from error
    except (SafetensorError, OSError, RecursionError, *DAMAGE) as error:
        raise _damaged(path, error) from error
    for name, tensor in tensors.items():
        if tensor.is_floating_point() and not torch.isfinite(tensor).all():
            raise DataError(f"{path} holds values in {name!r:.200} that are not finite.", AGAIN)
    return {name: tensor.to(device) for name, tensor in tensors.items()}, facts


@contextmanager
def restoring(path: Path) -> Iterator[None]:
    """While something is made of the file's tensors and facts: where they do not allow it, they are not as written.

    Raises DataError for that; errors of memory and those that are sentences already pass.
    """
    try:
        yield
    except DAMAGE as error:
        if is_out_of_memory(error):
            raise
        raise _damaged(path, error) from error


def _damaged(path: Path, error: Exception) -> DataError:
    return DataError(f"{path} is damaged ({type(error).__name__}: {error!s:.200}).", AGAIN)


def _header(metadata: dict[str, str]) -> dict[str, Any]:
    """Schema and facts of a file; the first versions wrote them as two entries."""
    if "karf" in metadata:
        return json.loads(metadata["karf"], parse_constant=_refuse)
    facts = json.loads(metadata.get("facts", "{}"), parse_constant=_refuse)
    return {"schema": metadata.get("schema"), "facts": facts}


def _refuse(constant: str) -> None:
    raise ValueError(f"{constant} among the facts")
