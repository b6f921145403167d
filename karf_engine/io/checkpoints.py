"""Checkpoints: tensors and JSON metadata in safetensors files. Nothing in a file is executed."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save_file
from torch import Tensor

from ..errors import DataError
from .failures import is_out_of_memory
from .files import atomic_write, check_file, library_path

AGAIN = "Run the stage that writes it again."
# raised by code that restores objects from damaged tensors or metadata
DAMAGE = (ArithmeticError, AttributeError, LookupError, RuntimeError, TypeError, ValueError)


def save_tensors(path: Path, tensors: dict[str, Tensor], schema: str, metadata: dict[str, Any]) -> None:
    """Write tensors, JSON metadata and a schema (kind and version) atomically; equal content gives equal bytes."""
    # one entry, because safetensors writes several in any order
    header = {"karf": json.dumps({"schema": schema, "facts": metadata})}
    stored = {name: tensor.detach().cpu().contiguous() for name, tensor in tensors.items()}

    def write(temporary: Path) -> None:
        with library_path(temporary) as writable:
            save_file(stored, writable, header)

    atomic_write(path, write)


def load_tensors(
    path: Path, schema: str | tuple[str, ...], device: torch.device | str = "cpu"
) -> tuple[dict[str, Tensor], dict[str, Any]]:
    """Read tensors, on a device, and metadata of a file with one of the accepted schemas.

    Raises DataError if the file is missing, damaged or of another schema, or a tensor is not finite or cannot be checked.
    """
    if path.exists():
        check_file(path, sys.maxsize)
    try:
        with library_path(path) as readable, safe_open(readable, "pt") as stored:
            header = _header(stored.metadata() or {})
            found = header.get("schema")
            known = (schema,) if isinstance(schema, str) else schema
            if found not in known:
                raise DataError(f"{path} holds {found!r:.200}, not {known[-1]!r}.", AGAIN)
            # clone, because Windows cannot replace a file that is memory-mapped
            tensors = {name: stored.get_tensor(name).clone() for name in stored.keys()}
            metadata = header["facts"]
    except FileNotFoundError as error:
        raise DataError("{path} does not exist.", "Run the stage that writes it.", path=path) from error
    except (SafetensorError, OSError, RecursionError, *DAMAGE) as error:
        if is_out_of_memory(error):
            raise
        raise _damaged(path, error) from error
    for name, tensor in tensors.items():
        try:
            is_finite = torch.isfinite(tensor).all()
        except NotImplementedError as error:  # for types such as float8_e4m3fn
            raise DataError(f"{path} holds {name!r:.200} as {tensor.dtype}, which is not read.", AGAIN) from error
        if not is_finite:
            raise DataError(f"{path} holds values in {name!r:.200} that are not finite.", AGAIN)
    return {name: tensor.to(device) for name, tensor in tensors.items()}, metadata


@contextmanager
def damage_as_data_error(path: Path) -> Iterator[None]:
    """Raise DataError for any error of the block that a damaged file can cause; out-of-memory errors pass."""
    try:
        yield
    except DAMAGE as error:
        if is_out_of_memory(error):
            raise
        raise _damaged(path, error) from error


def _damaged(path: Path, error: Exception) -> DataError:
    return DataError(
        "{path} is damaged ({kind}: {error!s:.200}).", AGAIN, path=path, kind=type(error).__name__, error=error
    )


def _header(entries: dict[str, str]) -> dict[str, Any]:
    """Return schema and metadata ("facts"); the first versions wrote them as two entries."""
    if "karf" in entries:
        return json.loads(entries["karf"], parse_constant=_refuse)
    metadata = json.loads(entries.get("facts", "{}"), parse_constant=_refuse)
    return {"schema": entries.get("schema"), "facts": metadata}


def _refuse(constant: str) -> None:
    raise ValueError(f"{constant} among the metadata")
