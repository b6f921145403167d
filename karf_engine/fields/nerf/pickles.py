"""Pickles of other programs, looked through before they are read as data: what they name, and what they claim to hold."""

from __future__ import annotations

import pickletools
import zipfile
from pathlib import Path
from typing import BinaryIO

# what tensors, dictionaries of them and the numbers with them are made of; torch itself also calls classes by which a
# few bytes take any memory
NAMES = {
    "collections OrderedDict",
    "torch._utils _rebuild_tensor_v2",
    "torch._utils _rebuild_parameter",
    "torch.nn.parameter Parameter",
    "torch Size",
    "torch device",
    "_codecs encode",
    "numpy dtype",
    "numpy.core.multiarray scalar",
    "numpy._core.multiarray scalar",
    *(f"numpy.dtypes {kind}DType" for kind in ("Float32", "Float64", "Int32", "Int64")),
    *(f"torch {kind}Storage" for kind in ("Float", "Double", "Half", "BFloat16", "Int", "Long", "Bool", "Byte")),
}
PUTS = ("PUT", "BINPUT", "LONG_BINPUT")
PICKLES_OF_OLD_FILES = 5  # pickles: magic number, version, system, content, keys of the storages that follow


def check_torch_file(path: Path) -> None:
    """Raise ValueError where a file of torch.save names what no checkpoint of numbers does, or packs its numbers."""
    with path.open("rb") as file:
        if file.read(4) != b"PK\3\4":
            file.seek(0)
            for _ in range(PICKLES_OF_OLD_FILES):
                check_pickle(file, path.stat().st_size)
            return
    with zipfile.ZipFile(path) as archive:
        if sum(record.file_size for record in archive.infolist()) > path.stat().st_size:
            raise ValueError("its records are packed, as torch never does")
        for record in archive.infolist():
            if record.filename.endswith("data.pkl"):
                with archive.open(record) as file:
                    check_pickle(file, record.file_size)


class _Bounded:
    """A file that is asked for no more than it holds: Python makes room for all that it is asked for."""

    def __init__(self, file: BinaryIO, length: int) -> None:
        self._file, self._length = file, length
        self.readline, self.tell = file.readline, file.tell

    def read(self, size: int) -> bytes:
        return self._file.read(min(size, self._length))


def check_pickle(file: BinaryIO, length: int, names: set[str] | None = NAMES) -> None:
    """Walk through the pickle at the file's position; nothing is made of it.

    length: bytes of the file. names: what it may ask for, None where the reader checks that. Raises ValueError for
    another name, for a place in the reader's table beyond what the file can fill, and where the pickle is cut off.
    """
    for opcode, argument, _ in pickletools.genops(_Bounded(file, length)):
        if opcode.name in PUTS and int(argument) > length:
            raise ValueError(f"it numbers an entry {argument} in {length} bytes")
        if names is not None and opcode.name == "GLOBAL" and argument not in names:
            raise ValueError(f"it asks for {argument.replace(' ', '.')}, which is not a number")
