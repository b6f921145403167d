"""Every reader reads a mutated file or rejects it with a message, and does nothing else (watch.py).

Run with many more files: python3 tools/dev.py fuzz.
"""

import os
import pickle
from dataclasses import dataclass, field

import pytest
from hypothesis import HealthCheck, event, given, settings
from hypothesis import strategies as st

from blender_tests.engine.readers.registry import project_readers, readers
from blender_tests.engine.readers.samples import renew_checksum
from blender_tests.engine.readers.watch import Flaw, read_watched

READERS = {reader.name: reader for reader in readers()}
OF_PROJECT = [reader.name for reader in project_readers(None)]
MUTANTS = 20  # without the option --mutants


@dataclass(frozen=True)
class Mutant:
    name: str
    data: bytes = field(repr=False)


@pytest.mark.parametrize("name", [*READERS, *OF_PROJECT])
def test_mutated_files_are_read_or_rejected(name, tmp_path, request):
    """A file that breaks a reader is left in the folder."""
    if name in OF_PROJECT:
        reader = project_readers(request.getfixturevalue("project"))[OF_PROJECT.index(name)]
    else:
        reader = READERS[name]
    reader.make(tmp_path)
    assert [file for file in reader.files if not read_watched(reader.read, tmp_path / file, tmp_path)] == []

    mutants = request.config.getoption("mutants", None)
    number = (mutants or MUTANTS) // reader.share
    kept = [file for file in (*reader.files, "project.json") if (tmp_path / file).exists()]
    valid = {file: (tmp_path / file).read_bytes() for file in kept}
    files = st.sampled_from(reader.files).flatmap(
        lambda file: st.builds(Mutant, st.just(file), reader.mutation(valid[file]))
    )

    @settings(max_examples=max(2, number), deadline=None, derandomize=mutants is None, database=None,
              suppress_health_check=HealthCheck)  # fmt: skip
    @given(files)
    def check(changed):
        for file, data in valid.items():
            (tmp_path / file).write_bytes(data)
        path = tmp_path / changed.name
        path.write_bytes(changed.data)
        renew_checksum(tmp_path, path)  # a hostile project may have valid checksums
        event("read" if read_watched(reader.read, path, tmp_path) else "rejected with a message")

    check()


def write_outside(path):
    (path.parents[1] / "outside.txt").write_text("x")


def hide_a_write(path):
    try:
        write_outside(path)
    except OSError:
        pass


@pytest.mark.parametrize(
    ("read", "raised", "words"),
    [
        (lambda path: bytearray(2 << 30), MemoryError, ""),
        (write_outside, PermissionError, "writes outside"),
        (hide_a_write, Flaw, "writes outside"),
        (lambda path: pickle.loads(pickle.dumps(os.getpid)), PermissionError, r"pickle\.find_class"),
        (lambda path: {}["absent"], KeyError, "absent"),
    ],
)
def test_watch_reports_and_prevents_forbidden_actions(tmp_path, read, raised, words):
    with pytest.raises(raised, match=words or None):
        read_watched(read, tmp_path / "inside" / "file", tmp_path / "inside")
    assert not (tmp_path / "outside.txt").exists()
