"""A function run in a child process with limits of memory and time.

For decoders that crash on damaged files, or that make room for whatever a file claims. On Windows and macOS, which do not
limit memory, the time alone ends them.
"""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable, Mapping, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import DataError, KarfError, Message, error_from_code
from .failures import first_line, is_out_of_memory, known_failure
from .files import read_json
from .inputs import check_file
from .npz import read_arrays

LEAST_BYTES = 2 << 30  # of memory; libraries and their threads have reserved up to half of it before a file is read
BYTES_PER_BYTE = 24  # of memory for one of the file
LEAST_SECONDS, SECONDS_PER_MEGABYTE = 60, 1  # of the processor
PATIENCE = 2  # by how much longer the clock may run: for slow disks
RESULT, FAILURE = "result.npz", "failure.json"
FEW_RESERVATIONS = {"OPENBLAS_NUM_THREADS": "1", "MALLOC_ARENA_MAX": "2"}  # each would reserve memory for every core
AGAIN = "Export or copy the file again."


def run_limited(
    work: Callable[..., Mapping[str, np.ndarray]], path: Path, names: Sequence[str], *more: str
) -> list[np.ndarray]:
    """Call `work(path, *more)` in a child process that ends with this one.

    Args:
        work: A function of a module of this package.
        path: The file that it reads.
        names: Of the arrays that it gives.
        *more: Its further arguments.

    Returns:
        The arrays, in the order of the names.

    Raises:
        DataError: The file is missing, or the child crashed or passed a limit.
        KarfError: What `work` raised.
    """
    size = check_file(path)
    seconds = LEAST_SECONDS + SECONDS_PER_MEGABYTE * size // 10**6
    root = str(Path(__file__).parents[2])  # the engine may run as a folder, off the path that a child gets
    program = f"import sys; sys.path.insert(0, {root!r}); from {__name__} import main; main(*sys.argv[1:])"
    n_bytes = LEAST_BYTES + BYTES_PER_BYTE * size
    with tempfile.TemporaryDirectory() as folder:
        arguments = [work.__module__, work.__name__, path, folder, str(n_bytes), str(seconds), json.dumps(more)]
        command = [sys.executable, "-I", "-B", "-X", "utf8", "-c", program, *arguments]
        with subprocess.Popen(
            command, env=os.environ | FEW_RESERVATIONS,
            stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        ) as child:  # fmt: skip
            try:
                code = child.wait(PATIENCE * seconds)
            except subprocess.TimeoutExpired as error:
                raise _refused(path, f"it takes more than {PATIENCE * seconds} s") from error
            finally:
                child.kill()
        failure = Path(folder) / FAILURE
        if failure.exists():
            raise _told(read_json(failure, "failure"))
        if code:
            raise _refused(path, f"its decoder crashed or needed too much memory or time (exit code {code})")
        return read_arrays(Path(folder) / RESULT, names, "result", AGAIN)


def main(module: str, name: str, path: str, folder: str, n_bytes: str, seconds: str, more: str) -> None:
    """What the child does: arrays or a sentence into the folder."""
    threading.Thread(target=_end_with_parent, daemon=True).start()
    _limit(int(n_bytes), int(seconds))
    try:
        arrays = getattr(import_module(module), name)(Path(path), *json.loads(more))
        np.savez(Path(folder) / RESULT, **arrays)
    except Exception as error:
        if is_out_of_memory(error):
            known: KarfError = _refused(path, f"it takes more than {int(n_bytes):,} bytes of memory")
        else:
            known = known_failure(error) or _refused(path, first_line(error))
        told = {"code": known.code, "sentence": known.sentence.to_json(), "hint": known.hint.to_json()}
        (Path(folder) / FAILURE).write_text(json.dumps(told), encoding="utf-8")


def _end_with_parent() -> None:
    sys.stdin.read()
    os._exit(1)


def _limit(n_bytes: int, seconds: int) -> None:
    """Limit this process's memory and time; a crash leaves no image of its memory on the disk."""
    try:
        import resource
    except ImportError:  # Windows
        return
    for kind, most in ((resource.RLIMIT_AS, n_bytes), (resource.RLIMIT_CPU, seconds), (resource.RLIMIT_CORE, 0)):
        _, hard = resource.getrlimit(kind)
        with contextlib.suppress(OSError, ValueError):  # macOS refuses the first, or sets it and does not heed it
            resource.setrlimit(kind, (most if hard == resource.RLIM_INFINITY else min(most, hard), hard))


def _told(content: dict[str, Any]) -> KarfError:
    return error_from_code(content["code"], *(Message.from_json(content[name]) for name in ("sentence", "hint")))


def _refused(path: Path | str, reason: str) -> DataError:
    return DataError("{path} cannot be read: {reason}.", AGAIN, path=path, reason=reason)
