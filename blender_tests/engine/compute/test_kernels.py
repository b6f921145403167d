"""Kernels compile without a cache and recompile from a damaged one."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("numba")

from numba.core.caching import FunctionCache

from blender_tests.engine.conftest import ROOT
from karf_engine.compute.kernels import kernel

PROGRAM = """
import sys
sys.path.insert(0, {root!r})
from karf_engine.compute.kernels import kernel

@kernel
def double(x):
    return 2 * x

print(double(21), double._cache_hits.total())
"""


def flip_bit(data, at):
    return data[:at] + bytes([data[at] ^ 1]) + data[at + 1 :]


def test_kernel_compiles_without_a_writable_folder(monkeypatch):
    monkeypatch.setattr(FunctionCache._impl_class, "_locator_classes", [])  # numba finds no place for its files

    @kernel
    def double(x):
        return 2 * x

    assert double(21) == 42


@pytest.fixture
def run_program(tmp_path):
    """Run a program with one kernel; return its output and the cache file of the machine code."""
    program, cache = tmp_path / "program.py", tmp_path / "cache"
    program.write_text(PROGRAM.format(root=str(ROOT)))
    environment = os.environ | {"NUMBA_CACHE_DIR": str(cache)}

    def run() -> tuple[str, Path]:
        done = subprocess.run([sys.executable, program], env=environment, capture_output=True, text=True, timeout=120)
        assert (done.returncode, done.stderr) == (0, "")
        [file] = [path for path in cache.rglob("*") if path.is_file()]
        return done.stdout.strip(), file

    return run


def test_damaged_machine_code_is_compiled_and_stored_again(run_program, subtests):
    output, file = run_program()
    data = file.read_bytes()
    assert (output, run_program()[0]) == ("42 0", "42 1")
    for name, damaged in {
        "emptied": b"",
        "cut in half": data[: len(data) // 2],
        "one bit flipped": flip_bit(data, len(data) // 2),
        "one bit of its digest flipped": flip_bit(data, 0),
    }.items():
        with subtests.test(name):
            file.write_bytes(damaged)
            assert run_program()[0] == "42 0"
            assert run_program()[0] == "42 1"


def test_unreadable_machine_code_is_compiled_each_time(run_program):
    _, file = run_program()
    file.unlink()
    file.mkdir()
    (file / "file").touch()
    assert run_program()[0] == "42 0"
