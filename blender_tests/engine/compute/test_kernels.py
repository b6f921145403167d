"""Compiled kernels on computers that keep nothing, or keep it badly."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("numba")

from numba.core.caching import FunctionCache

from blender_tests.engine.conftest import ROOT
from karf_engine.compute.kernels import kernel

DOUBLED = """
import sys
sys.path.insert(0, {root!r})
from karf_engine.compute.kernels import kernel

@kernel
def double(x):
    return 2 * x

print(double(21), double._cache_hits.total())
"""


def flipped(data, at):
    return data[:at] + bytes([data[at] ^ 1]) + data[at + 1 :]


DAMAGE = {
    "emptied": lambda data: b"",
    "cut in half": lambda data: data[: len(data) // 2],
    "one bit flipped": lambda data: flipped(data, len(data) // 2),
    "one bit of its digest flipped": lambda data: flipped(data, 0),
}


def test_a_kernel_compiles_without_a_writable_folder(monkeypatch):
    monkeypatch.setattr(FunctionCache._impl_class, "_locator_classes", [])  # numba finds no place for its files

    @kernel
    def double(x):
        return 2 * x

    assert double(21) == 42


@pytest.fixture
def doubled(tmp_path):
    """Run a program with one kernel: what it prints, and the file that keeps its machine code."""
    program, cache = tmp_path / "program.py", tmp_path / "cache"
    program.write_text(DOUBLED.format(root=str(ROOT)))
    environment = os.environ | {"NUMBA_CACHE_DIR": str(cache)}

    def run() -> tuple[str, Path]:
        done = subprocess.run([sys.executable, program], env=environment, capture_output=True, text=True, timeout=120)
        assert (done.returncode, done.stderr) == (0, "")
        [kept] = [path for path in cache.rglob("*") if path.is_file()]
        return done.stdout.strip(), kept

    return run


def test_damaged_machine_code_is_compiled_and_stored_again(doubled, subtests):
    first, kept = doubled()
    whole = kept.read_bytes()
    assert (first, doubled()[0]) == ("42 0", "42 1")
    for name, damage in DAMAGE.items():
        with subtests.test(name):
            kept.write_bytes(damage(whole))
            assert doubled()[0] == "42 0"
            assert doubled()[0] == "42 1"


def test_unreadable_machine_code_is_compiled_each_time(doubled):
    _, kept = doubled()
    kept.unlink()
    kept.mkdir()
    (kept / "file").touch()
    assert doubled()[0] == "42 0"
