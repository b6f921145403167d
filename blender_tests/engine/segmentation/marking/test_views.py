"""Views of a capture marked by the library, the command line and a worker."""

from pathlib import Path

import pytest

from blender_tests.engine.conftest import run_engine
from karf_engine import KarfError, mark, open_capture
from karf_engine.io.images import read_mask, read_photo
from karf_engine.segmentation.marking import proposals
from karf_engine.segmentation.marking.prompts import Prompts
from karf_engine.segmentation.marking.proposals import propose
from karf_engine.worker.queries import QUERIES
from karf_engine.worker.queries.session import Session


@pytest.fixture(scope="module")
def view(still_life):
    return open_capture(still_life.capture).split("train")[0]


@pytest.fixture(scope="module")
def middle(view):
    """A click in the middle of the view."""
    return view.camera.width // 2 + 0.5, view.camera.height // 2 + 0.5, True


@pytest.fixture(scope="module")
def expected(view, middle):
    return propose(read_photo(view.image), Prompts(points=(middle,)))


def test_library_writes_the_mask_of_a_view(still_life, view, middle, expected, tmp_path):
    path = mark(still_life.capture, view.name, "red ball", tmp_path, points=[middle])
    assert path == tmp_path / "red ball" / f"{view.name}.png"
    assert (read_mask(path) == expected).all() and expected.any()


def test_command_line_writes_the_same_mask(still_life, view, middle, expected, tmp_path):
    options = "--view", view.name, "--object", "ball", "--click", f"{middle[0]},{middle[1]}", "--out", tmp_path
    done = run_engine("mark", still_life.capture, *options)
    assert done.returncode == 0, done.stderr
    assert (read_mask(tmp_path / "ball" / f"{view.name}.png") == expected).all()


@pytest.mark.parametrize("wrong", [{"object_name": "a/b"}, {"view": "nothing"}, {"points": []}])
def test_invalid_marks_are_rejected_and_nothing_is_written(still_life, view, middle, tmp_path, wrong):
    options = {"view": view.name, "object_name": "ball", "points": [middle]} | wrong
    with pytest.raises(KarfError):
        mark(still_life.capture, masks=tmp_path, **options)
    assert not list(tmp_path.rglob("*.png"))


def test_worker_reads_a_photo_once(still_life, view, middle, expected, tmp_path, monkeypatch):
    read = []
    monkeypatch.setattr(proposals, "read_photo_of_view", lambda view: read.append(view) or read_photo(view.image))
    session, options = Session(tmp_path), {"capture": str(still_life.capture), "view": view.name}
    for prompts in (Prompts(box=(0.0, 0.0, 9.0, 9.0)), Prompts(points=(middle,))):
        answer = QUERIES["propose"](session, options | {"prompts": prompts.to_json()})
    assert (read_mask(Path(answer["mask"])) == expected).all() and len(read) == 1


def test_incomplete_query_names_what_is_missing(tmp_path):
    with pytest.raises(KarfError, match="without capture and prompts"):
        QUERIES["propose"](Session(tmp_path), {"view": "r_0"})
