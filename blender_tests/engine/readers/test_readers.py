"""Every reader and files that are nearly right: read, refused in a sentence, and never anything else.

What is never to happen stands in watch.py. Many more files: python3 tools/dev.py fuzz.
"""

import os
from dataclasses import dataclass, field

import pytest
from hypothesis import HealthCheck, event, given, settings
from hypothesis import strategies as st

pytest.importorskip("torch")
pytest.importorskip("resource", reason="time and memory are limited by signals, which Windows lacks")

from blender_tests.engine.faults.checksums import renew_checksum
from blender_tests.engine.readers.registry import readers
from blender_tests.engine.readers.watch import Flaw, read_watched

NAMES = [reader.name for reader in readers(None)]
MUTANTS = 20  # where no option says another number
SLOW_SHARE = 10  # a reader that renders gets so many times fewer


@dataclass(frozen=True)
class Changed:
    """A changed file."""

    name: str
    data: bytes = field(repr=False)


@pytest.fixture(params=NAMES)
def reader(request, project):
    return next(reader for reader in readers(project) if reader.name == request.param)


@pytest.fixture
def folder(reader, tmp_path):
    """The reader's valid files; the one that broke it is left here.

    What renders has done so once before it is watched: numba unpickles the compiled kernels that it keeps.
    """
    reader.make(tmp_path)
    if reader.is_slow:
        reader.read(tmp_path / reader.files[0])
    return tmp_path


def test_valid_files_are_read(reader, folder):
    assert [name for name in reader.files if not read_watched(reader.read, folder / name, folder)] == []


def test_changed_files_are_read_or_refused(reader, folder, request):
    mutants = request.config.getoption("mutants", None)
    number = (mutants or MUTANTS) // SLOW_SHARE if reader.is_slow else mutants or MUTANTS
    valid = {name: (folder / name).read_bytes() for name in (*reader.files, "project.json") if (folder / name).exists()}
    files = st.sampled_from(reader.files).flatmap(
        lambda name: st.builds(Changed, st.just(name), reader.mutation(valid[name]))
    )

    @settings(max_examples=max(2, number), deadline=None, derandomize=mutants is None, database=None,
              suppress_health_check=HealthCheck)  # fmt: skip
    @given(files)
    def changed_files_are_read_or_refused(changed):
        for name, data in valid.items():
            (folder / name).write_bytes(data)
        (folder / changed.name).write_bytes(changed.data)
        renew_checksum(
            folder, folder / changed.name
        )  # a project may come from a stranger whose checksums fit its hostile files
        event("read" if read_watched(reader.read, folder / changed.name, folder) else "refused in a sentence")

    changed_files_are_read_or_refused()


# -------------------------------------------------------------------------------------------- the watch sees what it must
def test_the_watch_sees_memory(tmp_path):
    with pytest.raises(MemoryError):
        read_watched(lambda path: bytearray(2 << 30), tmp_path / "file", tmp_path)


def test_the_watch_sees_and_prevents_writing_outside(tmp_path):
    outside = tmp_path / "outside.txt"
    with pytest.raises(PermissionError, match="writes outside"):
        read_watched(lambda path: outside.write_text("x"), tmp_path / "file", tmp_path / "inside")
    assert not outside.exists()


def test_the_watch_sees_what_a_reader_hides(tmp_path):
    def write(path):
        try:
            (tmp_path / "outside.txt").write_text("x")
        except OSError:
            pass

    with pytest.raises(Flaw, match="writes outside"):
        read_watched(write, tmp_path / "file", tmp_path / "inside")


def test_the_watch_sees_unpickling(tmp_path):
    import pickle

    data = pickle.dumps(os.getpid)
    with pytest.raises(PermissionError, match=r"pickle\.find_class"):
        read_watched(lambda path: pickle.loads(data), tmp_path / "file", tmp_path)


def test_the_watch_sees_a_trace(tmp_path):
    with pytest.raises(KeyError):
        read_watched(lambda path: {}["absent"], tmp_path / "file", tmp_path)
