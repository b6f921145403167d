"""Safety checks of foreign pickles before torch reads them."""

from __future__ import annotations

import pickletools
import zipfile
from pathlib import Path
from typing import IO, cast

# globals of tensors, dictionaries and scalars; torch allows more, where a few bytes can claim any memory
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
LEGACY_PICKLES = 5  # magic number, version, system, content, storage keys


def check_torch_file(path: Path) -> None:
    """Check a file of torch.save. Raise ValueError if it uses other globals or compressed records."""
    with path.open("rb") as file:
        if file.read(4) != b"PK\3\4":
            file.seek(0)
            for _ in range(LEGACY_PICKLES):
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
    """A file that reads at most its length: Python allocates all that a pickle asks for."""

    def __init__(self, file: IO[bytes], length: int) -> None:
        self._file, self._length = file, length
        self.readline, self.tell = file.readline, file.tell

    def read(self, size: int) -> bytes:
        return self._file.read(min(size, self._length))


def check_pickle(file: IO[bytes], length: int, names: set[str] | None = NAMES) -> None:
    """Check the next pickle of a file of `length` bytes without loading it. `names`: allowed globals, None for any.

    Raises:
        ValueError: Another global, a memo index beyond the length, or a truncated pickle.
    """
    for opcode, argument, _ in pickletools.genops(cast(IO[bytes], _Bounded(file, length))):
        if opcode.name in PUTS and int(argument or 0) > length:
            raise ValueError(f"it numbers an entry {argument} in {length} bytes")
        if names is not None and opcode.name == "GLOBAL" and argument not in names:
            raise ValueError(f"it asks for {str(argument).replace(' ', '.')}, which is not a number")
