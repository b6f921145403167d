"""Both packages run on Windows and macOS as far as their sources show: no call that these lack, no letters lost."""

import pytest

from blender_tests.engine.conftest import ROOT
from blender_tests.posix_only import unguarded, without_encoding

NOT_ON_WINDOWS = ("faults", "readers")  # folders of tests that their conftest.py leaves out there
PACKAGES = ("karf_engine", "karf_blender")


@pytest.mark.parametrize("package", [*PACKAGES, "blender_tests/engine"])
def test_nothing_that_windows_lacks_is_used_unless_the_system_was_asked(package):
    assert list(unguarded(ROOT / package, NOT_ON_WINDOWS)) == []


@pytest.mark.parametrize("package", PACKAGES)
def test_every_text_file_says_its_encoding(package):
    assert list(without_encoding(ROOT / package)) == []


@pytest.mark.parametrize(
    ("source", "found"),
    [
        ("import os\nos.fork()", 1),
        ("import fcntl", 1),
        ("from os import killpg", 1),
        ("import signal\nsignal.signal(signal.SIGHUP, f)", 1),
        ("import os\nif os.name == 'posix':\n    os.fork()", 0),
        ("import os\nn = len(os.sched_getaffinity(0)) if hasattr(os, 'sched_getaffinity') else 1", 0),
        ("import os\ndef f():\n    if os.name == 'nt':\n        return 0\n    return os.sysconf('SC_PAGE_SIZE')", 0),
        ("try:\n    import resource\nexcept ImportError:\n    resource = None", 0),
        ("import os, signal\ngetattr(signal, 'SIGKILL', signal.SIGTERM)\nos.replace('a', 'b')", 0),
    ],
)
def test_a_call_that_windows_lacks_is_found_unless_it_is_guarded(tmp_path, source, found):
    (tmp_path / "module.py").write_text(source, encoding="utf-8")
    assert len(list(unguarded(tmp_path))) == found


def test_a_text_file_in_the_systems_encoding_is_found(tmp_path):
    lines = ["p.read_text()", "p.open()", "open(p, 'w')", "p.open('rb')", "p.write_text(t, encoding='utf-8')", "f(p)"]
    (tmp_path / "module.py").write_text("\n".join(lines), encoding="utf-8")
    assert list(without_encoding(tmp_path)) == ["module.py:1", "module.py:2", "module.py:3"]
