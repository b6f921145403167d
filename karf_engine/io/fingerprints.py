"""Short texts that tell one input from another."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

from .inputs import check_file

WHOLE_BYTES, END_BYTES = 2**20, 2**18  # files up to here count whole, larger ones by their ends


def fingerprint(*parts: Any) -> str:
    """A short text that changes when any JSON value in `parts` does."""
    return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()[:16]


def file_digest(path: Path) -> list:
    """What tells a file from another one in its place: its size, and a hash of its content.

    Of a file over 1 MiB, its first and last 256 KiB: whoever takes another picture changes these.

    Raises:
        DataError: The file is missing, or is a folder, a pipe or a device.
    """
    size = check_file(path)
    with path.open("rb") as stream:
        if size <= WHOLE_BYTES:
            content = stream.read()
        else:
            content = stream.read(END_BYTES)
            stream.seek(-END_BYTES, 2)
            content += stream.read()
    return [size, hashlib.sha256(content).hexdigest()]
