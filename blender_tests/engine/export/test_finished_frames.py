"""The note of an output folder is read whatever stands in it, and never waited for."""

import pytest

pytest.importorskip("torch")

from blender_tests.engine.reference.no_files import NO_FILES
from karf_engine.errors import DataError
from karf_engine.export.finished_frames import RECORD_NAME, FinishedFrames
from karf_engine.io.files import file_digest


def test_lines_that_are_none_are_passed_over(tmp_path):
    good = '{"frame": "a", "made_from": "x", "files": {}}'
    lines = ["[" * 100_000, "{", "3", '{"frame": "b"}', good]
    (tmp_path / RECORD_NAME).write_text("\n".join(lines))
    assert list(FinishedFrames.read(tmp_path).frames) == ["a"]


@pytest.mark.parametrize("make", NO_FILES)
@pytest.mark.parametrize("read", [lambda path: FinishedFrames.read(path.parent), file_digest])
def test_what_lies_in_its_place_is_named(make, read, tmp_path):
    make(tmp_path / RECORD_NAME)
    with pytest.raises(DataError, match="not a file"):
        read(tmp_path / RECORD_NAME)
