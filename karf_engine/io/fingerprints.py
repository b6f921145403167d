"""Fingerprints of settings and files, to detect changed inputs."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

from .inputs import check_file

WHOLE_BYTES, END_BYTES = 2**20, 2**18  # larger files are hashed at both ends only


def fingerprint(*parts: Any) -> str:
    """Return a hash of JSON values, 16 hexadecimal digits."""
    return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()[:16]


def file_digest(path: Path) -> list:
    """Return [size, SHA-256] of a file; files over 1 MiB are hashed by their first and last 256 KiB."""
    size = check_file(path)
    with path.open("rb") as stream:
        if size <= WHOLE_BYTES:
            content = stream.read()
        else:
            content = stream.read(END_BYTES)
            stream.seek(-END_BYTES, 2)
            content += stream.read()
    return [size, hashlib.sha256(content).hexdigest()]
