"""Run a function in a child process with limits of memory and time.

For decoders that crash on damaged files or allocate whatever a file claims. Windows and macOS limit the time only.
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

import numpy as np

from ..errors import DataError, KarfError, Message, error_from_code
from .failures import first_line, is_out_of_memory, translate_error
from .files import check_file, read_json
from .npz import read_arrays

LEAST_BYTES = 2 << 30  # memory; libraries reserve up to half of it
BYTES_PER_BYTE = 24  # memory for each byte of the file
LEAST_SECONDS, SECONDS_PER_MEGABYTE = 60, 1  # CPU time
PATIENCE = 2  # wall time over CPU time, for slow disks
RESULT, FAILURE = "result.npz", "failure.json"
FEW_RESERVATIONS = {"OPENBLAS_NUM_THREADS": "1", "MALLOC_ARENA_MAX": "2"}  # both reserve memory for each core
AGAIN = "Export or copy the file again."


def run_limited(
    work: Callable[..., Mapping[str, np.ndarray]], path: Path, names: Sequence[str], *more: str
) -> list[np.ndarray]:
    """Call `work(path, *more)` in a child process that ends with this one, and return its arrays of these names.

    `work` is a module-level function of this package that returns arrays by name. Raises DataError if the file is missing or
    the child crashed or exceeded a limit, and the KarfErrors of `work`.
    """
    size = check_file(path)
    seconds = LEAST_SECONDS + SECONDS_PER_MEGABYTE * size // 10**6
    root = str(Path(__file__).parents[2])  # the package may be outside the child's sys.path
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
            content = read_json(failure, "failure")
            raise error_from_code(
                content["code"], Message.from_json(content["sentence"]), Message.from_json(content["hint"])
            )
        if code:
            raise _refused(path, f"its decoder crashed or needed too much memory or time (exit code {code})")
        return read_arrays(Path(folder) / RESULT, names, "result", AGAIN)


def main(module: str, name: str, path: str, folder: str, n_bytes: str, seconds: str, more: str) -> None:
    """Run in the child: write the arrays or the error into the folder."""
    threading.Thread(target=_end_with_parent, daemon=True).start()
    _limit(int(n_bytes), int(seconds))
    try:
        arrays = getattr(import_module(module), name)(Path(path), *json.loads(more))
        np.savez(Path(folder) / RESULT, **arrays)
    except Exception as error:
        if is_out_of_memory(error):
            known: KarfError = _refused(path, f"it takes more than {int(n_bytes):,} bytes of memory")
        else:
            known = translate_error(error) or _refused(path, first_line(error))
        content = {"code": known.code, "sentence": known.sentence.to_json(), "hint": known.hint.to_json()}
        (Path(folder) / FAILURE).write_text(json.dumps(content), encoding="utf-8")


def _end_with_parent() -> None:
    sys.stdin.read()
    os._exit(1)


def _limit(n_bytes: int, seconds: int) -> None:
    """Limit memory and CPU time of this process, and disable core dumps."""
    try:
        import resource
    except ImportError:  # Windows
        return
    for kind, most in ((resource.RLIMIT_AS, n_bytes), (resource.RLIMIT_CPU, seconds), (resource.RLIMIT_CORE, 0)):
        _, hard = resource.getrlimit(kind)
        with contextlib.suppress(OSError, ValueError):  # macOS rejects or ignores RLIMIT_AS
            resource.setrlimit(kind, (most if hard == resource.RLIM_INFINITY else min(most, hard), hard))


def _refused(path: Path | str, reason: str) -> DataError:
    return DataError("{path} cannot be read: {reason}.", AGAIN, path=path, reason=reason)
