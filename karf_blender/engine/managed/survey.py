"""Run by the environment's Python: which packages are there, and which of their files are missing or changed.

Prints one line of JSON: `installed` (name -> version) and `damaged` (names). Standard library only; imports nothing of
KaRF. What a package consists of stands in its RECORD (the specification of wheels), with sizes and hashes.
"""

import base64
import csv
import hashlib
import json
import os
import re
import shutil
import sysconfig
from pathlib import Path


def main() -> None:
    folder = Path(("\\\\?\\" if os.name == "nt" else "") + sysconfig.get_path("purelib"))  # paths of any length
    installed, damaged = {}, []
    for info in sorted(folder.glob("*.dist-info")):
        name, _, version = info.name[: -len(".dist-info")].partition("-")
        name = re.sub(r"[-_.]+", "-", name).lower()
        if not (info / "RECORD").is_file() or not (info / "METADATA").is_file():
            shutil.rmtree(info)  # half put in place: nothing but its files could show what to remove
            continue
        installed[name] = version
        if not is_whole(folder, info / "RECORD"):
            damaged.append(name)
    print(json.dumps({"installed": installed, "damaged": damaged}), flush=True)


def is_whole(folder: Path, record: Path) -> bool:
    """Whether all files of a package are there as they came."""
    with record.open(encoding="utf-8", newline="") as stream:
        for path, expected, size in csv.reader(stream):
            file = folder / path
            if path.endswith(".pyc"):
                continue
            if not file.is_file() or (size and file.stat().st_size != int(size)):
                return False
            if expected and hash_of(file, expected.partition("=")[0]) != expected.partition("=")[2]:
                return False
    return True


def hash_of(file: Path, kind: str) -> str:
    """A file's hash as RECORD writes it."""
    with file.open("rb") as stream:
        digest = hashlib.file_digest(stream, kind).digest()
    return base64.urlsafe_b64encode(digest).rstrip(b"=").decode("ascii")


if __name__ == "__main__":
    main()
