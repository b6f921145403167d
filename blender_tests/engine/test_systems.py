"""Both packages' sources use nothing that Windows lacks and name the encoding of every text file."""

import pytest

from blender_tests.engine.conftest import ROOT
from blender_tests.posix_only import unguarded, without_encoding

NOT_ON_WINDOWS = ("faults", "readers")  # folders of tests that their conftest.py skips there


@pytest.mark.parametrize("package", ["karf_engine", "karf_blender", "blender_tests/engine"])
def test_sources_run_on_windows_and_name_every_encoding(package):
    assert list(unguarded(ROOT / package, NOT_ON_WINDOWS)) == []
    assert package.startswith("blender_tests") or list(without_encoding(ROOT / package)) == []


@pytest.mark.parametrize(
    ("source", "is_found"),
    [
        ("import os\nos.fork()", True),
        ("import fcntl", True),
        ("from os import killpg", True),
        ("import signal\nsignal.signal(signal.SIGHUP, f)", True),
        ("import os\nif os.name == 'posix':\n    os.fork()", False),
        ("import os\nn = len(os.sched_getaffinity(0)) if hasattr(os, 'sched_getaffinity') else 1", False),
        ("import os\ndef f():\n    if os.name == 'nt':\n        return 0\n    return os.sysconf('PAGE')", False),
        ("try:\n    import resource\nexcept ImportError:\n    resource = None", False),
        ("import os, signal\ngetattr(signal, 'SIGKILL', signal.SIGTERM)\nos.replace('a', 'b')", False),
    ],
)
def test_unguarded_posix_calls_are_found(tmp_path, source, is_found):
    (tmp_path / "module.py").write_text(source, encoding="utf-8")
    assert len(list(unguarded(tmp_path))) == is_found


def test_text_files_without_encoding_are_found(tmp_path):
    lines = ["p.read_text()", "p.open()", "open(p, 'w')", "p.open('rb')", "p.write_text(t, encoding='utf-8')", "f(p)"]
    (tmp_path / "module.py").write_text("\n".join(lines), encoding="utf-8")
    assert list(without_encoding(tmp_path)) == ["module.py:1", "module.py:2", "module.py:3"]
