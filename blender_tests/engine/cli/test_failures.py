"""Faults of the system print one line and a hint and give the documented exit code."""

import errno
import io
import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import Mock

import numpy as np
import pytest

from blender_tests.engine.conftest import ROOT
from karf_engine.cli import main
from karf_engine.errors import Cancelled, OutOfMemory
from karf_engine.worker import loop
from karf_engine.worker.protocol import Request

FULL = Path("/dev/full")
needs_full = pytest.mark.skipif(not FULL.exists(), reason="this system has no /dev/full")


@pytest.fixture(autouse=True)
def no_input(monkeypatch):
    monkeypatch.setattr("sys.stdin", io.StringIO())


def engine(*arguments, **options):
    """Run the engine in a child process."""
    command = [sys.executable, "-m", "karf_engine", *map(str, arguments)]
    return subprocess.run(command, cwd=ROOT, timeout=300, **options)


@pytest.fixture
def run_raising(capsys, monkeypatch):
    """Run a command whose stage raises an error; returns its exit code and what it prints."""

    def run_raising(error):
        monkeypatch.setattr("karf_engine.cli.verbs.run_command", Mock(side_effect=error))
        return main(["palette", "project"]), capsys.readouterr().err

    return run_raising


def memory_errors():
    """Each kind of failed allocation, raised by the library itself where that costs nothing."""
    torch, cv2 = pytest.importorskip("torch"), pytest.importorskip("cv2")
    for allocate, size in ((np.empty, 50), (np.empty, 60), (torch.empty, 58), (torch.empty, 62), (bytearray, 62)):
        with pytest.raises(Exception) as caught:
            allocate(2**size)
        yield caught.value
    yield torch.OutOfMemoryError("CUDA out of memory. Tried to allocate 2.00 GiB")
    yield RuntimeError("std::bad_alloc")
    yield ImportError("The `pillow` plugin is not installed. Use `pip install imageio[pillow]` to install it.")
    yield OSError(errno.ENOMEM, os.strerror(errno.ENOMEM))
    yield cv2.error("OpenCV(4.9.0) alloc.cpp:73: error: (-4:Insufficient memory) Failed to allocate 600 bytes")


def test_failed_allocation_of_any_library_exits_with_5(run_raising):
    from karf_engine.fields.training import is_out_of_memory

    for error in memory_errors():
        code, printed = run_raising(error)
        assert code == 5 and printed.startswith("error: The computer ran out of memory."), repr(error)
        assert is_out_of_memory(error), repr(error)  # the training loop halves its batch for the same errors


FILE = "/film/pots/palette.json"
LONG = "C:\\" + "very_long_folder\\" * 16 + "geometry.safetensors"
FULL_DISK, TOO_LONG, MISSING, NOT_ALLOWED = "The disk is full", "a name too long", "is not there", "may not be read or"
ERRNO_WORDS = [
    *((errno.ENOSPC, FULL_DISK), (errno.EDQUOT, "Your share of the disk is used up"), (errno.EACCES, NOT_ALLOWED)),
    *((errno.EROFS, "can only be read"), (errno.ENOENT, MISSING), (errno.ENOTDIR, "lies in a file")),
    *((errno.ENAMETOOLONG, TOO_LONG), (errno.EMFILE, "Too many files are open")),
    (errno.EIO, "cannot be read or written: Input/output error"),
]
FAULTS = [  # system, error, words; numbers and messages of Windows are from its manual
    *((os.name, OSError(number, os.strerror(number), FILE), words) for number, words in ERRNO_WORDS),
    ("posix", RuntimeError("Error while serializing: I/O error: No space left on device (os error 28)"), FULL_DISK),
    ("posix", RuntimeError("IoError(Os { code: 28, kind: StorageFull })"), FULL_DISK),
    ("posix", OSError("1048576 requested and 4096 written"), FULL_DISK),
    ("posix", RuntimeError("database or disk is full"), FULL_DISK),
    ("nt", RuntimeError("I/O error: There is not enough space on the disk. (os error 112)"), FULL_DISK),
    ("nt", RuntimeError("I/O error: The process cannot access the file (os error 32)"), NOT_ALLOWED),
    ("nt", RuntimeError("I/O error: The filename or extension is too long. (os error 206)"), TOO_LONG),
    ("nt", RuntimeError("I/O error: The system cannot find the path specified. (os error 3)"), MISSING),
    ("nt", FileNotFoundError(2, "No such file", LONG), TOO_LONG),
    ("nt", FileNotFoundError(2, "No such file", "C:\\a.png"), MISSING),
]


@pytest.mark.parametrize(("system", "error", "words"), FAULTS)
def test_disk_fault_prints_one_line_and_a_hint(run_raising, monkeypatch, system, error, words):
    monkeypatch.setattr("karf_engine.io.failures.os", SimpleNamespace(name=system))
    code, printed = run_raising(error)
    sentence, hint = printed.strip().split("\n")
    assert code == 4 and words in sentence and hint.strip() and "Traceback" not in printed
    assert (FILE in sentence) == (getattr(error, "filename", None) == FILE and error.errno != errno.EMFILE)


@pytest.mark.parametrize(("error", "code"), [(OutOfMemory("None left."), 5), (Cancelled("Stopped."), 6)])
def test_unwritable_events_keep_exit_code_and_message(tmp_path, capsys, monkeypatch, error, code):
    def write(kind, /, **values):
        if kind != "hello":
            raise OSError(errno.ENOSPC, "No space left on device")

    Request("palette", tmp_path).write(tmp_path / "job")
    monkeypatch.setattr(loop, "EventWriter", lambda job: write)
    monkeypatch.setattr(loop, "run_command", Mock(side_effect=error))
    assert loop.Worker().serve(tmp_path / "job", ()) == code
    assert error.sentence in capsys.readouterr().err


@needs_full
def test_log_on_full_disk_keeps_the_exit_code(tmp_path):
    with FULL.open("w") as full:
        assert engine("palette", tmp_path, stderr=full).returncode == 4


@needs_full
def test_events_on_full_disk_end_job_with_one_line(tmp_path):
    Request("palette", tmp_path).write(tmp_path)
    (tmp_path / "events.jsonl").symlink_to(FULL)
    done = engine("run", tmp_path, capture_output=True, text=True)
    assert done.returncode == 4 and "The disk is full" in done.stderr and "Traceback" not in done.stderr


@pytest.mark.skipif(os.name == "nt", reason="there is no SIGPIPE")
@pytest.mark.parametrize(("verb", "buffered"), [("settings", "1"), ("settings", ""), ("doctor --quick", "")])
def test_closed_output_pipe_ends_command_quietly(verb, buffered):
    reading, writing = os.pipe()
    os.close(reading)
    environment = os.environ | {"PYTHONUNBUFFERED": buffered}
    done = engine(*verb.split(), env=environment, stdout=writing, stderr=subprocess.PIPE)
    os.close(writing)
    assert (done.returncode, done.stderr) == (141, b"")


IMPORT_IN_LITTLE_MEMORY = """
import resource, sys
from pathlib import Path
import numpy
from karf_engine.compute.kernels import has_kernels
from karf_engine.io.color_spaces import color_space
from karf_engine.io.failures import translate_error
from karf_engine.splats.formats.splat_file import needing_packages

def gaussians():
    with needing_packages():
        import {package}

used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
resource.setrlimit(resource.RLIMIT_AS, (used + (8 << 20),) * 2)
try:
    {use}
    sys.exit("has enough")
except Exception as error:
    known = translate_error(error)
    sys.exit(repr(error) if known is None else known.exit_code)
"""


USES = {"numba": "has_kernels()", "PyOpenColorIO": "color_space('ACEScg')"}  # others are loaded with splats


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="memory is limited and measured in Linux's way")
@pytest.mark.parametrize("package", [*USES, "gsply", "pxr.Usd"])
def test_package_import_without_memory_is_not_called_missing(package):
    pytest.importorskip(package.partition(".")[0])
    code = IMPORT_IN_LITTLE_MEMORY.format(package=package, use=USES.get(package, "gaussians()"))
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, timeout=300)
    assert done.returncode == 5, done.stderr
