"""Learned tensors on disk: safetensors with their settings in the header. Data only; nothing in a file is ever run."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save_file
from torch import Tensor

from .errors import DataError
from .project import atomic_write


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
                raise DataError(f"{path} holds {found!r}, not {schema!r}.", "Run the stage that writes it again.")
            tensors = {name: stored.get_tensor(name) for name in stored.keys()}
            facts = header["facts"]
    except FileNotFoundError as error:
        raise DataError(f"{path} does not exist.", "Run the stage that writes it.") from error
    except (SafetensorError, OSError, KeyError, ValueError) as error:
        raise DataError(f"{path} is damaged ({error}).", "Run the stage that writes it again.") from error
    for name, tensor in tensors.items():
        if tensor.is_floating_point() and not torch.isfinite(tensor).all():
            raise DataError(
                f"{path} holds values in {name!r} that are not finite.", "Run the stage that writes it again."
            )
    return {name: tensor.to(device) for name, tensor in tensors.items()}, facts


def _header(metadata: dict[str, str]) -> dict[str, Any]:
    """Schema and facts of a file; the first versions wrote them as two entries."""
    if "karf" in metadata:
        return json.loads(metadata["karf"])
    return {"schema": metadata.get("schema"), "facts": json.loads(metadata.get("facts", "{}"))}
