"""Long sequences: frames that are finished are kept where they would come out the same, and memory does not grow."""

import gc
import json
import shutil
import tracemalloc
import weakref
from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("torch")
pytest.importorskip("scipy")

import karf_engine as karf
from blender_tests.engine.reference.still_life import camera_at
from karf_engine.capture import write_cameras
from karf_engine.capture.capture import View
from karf_engine.errors import BadRequest, Cancelled
from karf_engine.export.finished_frames import RECORD_NAME, FinishedFrames, model_fingerprint, view_fingerprint
from karf_engine.io.images import read_photo
from karf_engine.palettes.palette import Edit, write_edit
from karf_engine.project import Project
from karf_engine.recolor.model import Model

BLUE = np.array([0.1, 0.2, 0.8])


class Sequence:
    """A path of cameras round the still life, and an edit."""

    def __init__(self, project, folder, count, size=8):
        self.project, self.folder, self.out = project, folder, folder / "out"
        self.cameras, self.edit = folder / "cameras.json", folder / "edit.json"
        self.angles = [0.02 * number for number in range(count)]
        self.size = size
        self.paint(BLUE)
        self.move()

    def paint(self, color):
        palettes = karf.load(self.project, device="cpu").palettes
        colors = {palette.name: palette.colors.copy() for palette in palettes}
        colors["ball"][1] = color
        write_edit(self.edit, Edit(colors))

    def move(self, number=0, angle=0.0):
        self.angles[number] = angle
        views = [
            View(f"f_{n:03d}", f"f_{n:03d}", camera_at(angle, 0.5, size=self.size), None, "train")
            for n, angle in enumerate(self.angles)
        ]
        write_cameras(self.cameras, views)

    def render(self, **options):
        """Render what is not there; returns the names of the frames that were written."""
        before = self.times()
        options = {"views": str(self.cameras), "edit": self.edit, "skip_existing": True} | options
        karf.render(self.project, self.out, threads=1, device="cpu", **options)
        return sorted(name for name, time in self.times().items() if before.get(name) != time)

    def times(self):
        return {path.stem: path.stat().st_mtime_ns for path in (self.out / "recolor").glob("*.png")}


@pytest.fixture
def sequence(learned, tmp_path):
    project = shutil.copytree(learned.project, tmp_path / "project")
    return Sequence(project, tmp_path, 4)


ALL = ["f_000", "f_001", "f_002", "f_003"]


def test_without_the_option_every_frame_is_rendered_again(sequence):
    assert sequence.render() == ALL and sequence.render() == []
    assert sequence.render(skip_existing=False) == ALL


def test_a_frame_is_rendered_again_where_its_camera_moved(sequence):
    sequence.render()
    sequence.move(2, 1.5)
    assert sequence.render() == ["f_002"]


def test_frames_are_rendered_again_where_the_edit_changed(sequence):
    sequence.render()
    sequence.paint(BLUE * 0.5)
    assert sequence.render() == ALL
    same = json.loads(sequence.edit.read_text())
    sequence.edit.write_text(json.dumps(same, indent=4))
    assert sequence.render() == []


def test_photos_are_recolored_again_where_a_mask_changed_and_other_cameras_are_not(sequence):
    project = Project(sequence.project)
    mask = next(project.masks_folder.rglob("*.png"))
    photo = Model(project).capture.split("test")[0]
    bare = replace(photo, image=None)

    def marks_of_views():
        mark = model_fingerprint(project, Model(project).settings)
        return view_fingerprint(mark, photo), view_fingerprint(mark, bare)

    before = marks_of_views()
    assert marks_of_views() == before
    mask.unlink()
    after = marks_of_views()
    assert after[0] != before[0] and after[1] == before[1]


def test_frames_are_rendered_again_where_more_is_asked_for(sequence):
    sequence.render()
    assert sequence.render(depth=True) == ALL and sequence.render(depth=True) == []


def test_frames_are_rendered_again_where_the_model_changed(sequence):
    sequence.render()
    project = Project(sequence.project)
    project.finish(
        "recoloring", "another", **{k: v for k, v in project.finished("recoloring").items() if k in ("files", "folder")}
    )
    assert sequence.render() == ALL


def test_a_frame_that_is_missing_or_cut_off_is_rendered_again(sequence):
    sequence.render()
    (sequence.out / "recolor" / "f_001.png").unlink()
    (sequence.out / "render" / "f_003.png").write_bytes(b"\x89PNG")
    assert sequence.render() == ["f_001", "f_003"]


@pytest.mark.parametrize("damage", ["", "\0\0\n{]\n[]\n7\n", '{"frame": "f_000", "made_from": "x"}\n'])
def test_a_damaged_note_costs_frames_and_nothing_else(sequence, damage):
    sequence.render()
    note = sequence.out / RECORD_NAME
    lines = note.read_text().split("\n")
    note.write_text(damage + "\n".join(lines)[:-40])  # killed while writing the last line
    assert sequence.render() == ["f_003"]
    assert sequence.render() == []


def test_a_cancelled_sequence_keeps_its_frames_and_goes_on(sequence):
    asked = []

    def stop_after_two():
        asked.append(None)
        return len(asked) > 2

    with pytest.raises(Cancelled):
        sequence.render(should_stop=stop_after_two)
    kept = sorted(sequence.times())
    assert kept == ALL[: len(kept)] and 0 < len(kept) < 4
    assert sequence.render() == ALL[len(kept) :]


def test_progress_counts_what_was_there_already(sequence):
    sequence.render()
    (sequence.out / "recolor" / "f_001.png").unlink()
    steps = []
    sequence.render(emit=lambda event, **values: steps.append(values) if event == "progress" else None)
    assert [(step["step"], step["total"]) for step in steps] == [(4, 4)]


def test_frames_of_a_camera_may_be_deep_and_transparent(sequence):
    sequence.render()
    opaque = read_photo(sequence.out / "recolor" / "f_001.png")
    karf.render(sequence.project, sequence.out, views=str(sequence.cameras), edit=sequence.edit, threads=1, device="cpu",
                format="exr16", alpha=True)  # fmt: skip
    clear = read_photo(sequence.out / "recolor" / "f_001.exr")
    alpha = clear[..., 3:]
    assert alpha.min() < 0.05 and alpha.max() > 0.95
    # behind the still life is black
    np.testing.assert_allclose(clear[..., :3] * alpha, opaque, atol=0.01)
    with pytest.raises(BadRequest, match="format = 'gif' is unknown"):
        sequence.render(format="gif")


def test_the_note_says_what_each_frame_was_made_from(sequence):
    sequence.render()
    finished = FinishedFrames.read(sequence.out)
    assert sorted(finished.frames) == ALL
    entry = finished.frames["f_001"]
    assert set(entry["files"]) == {f"{kind}/f_001.png" for kind in ("render", "recolor", "masks/ball", "masks/block")}
    assert finished.has("f_001", entry["made_from"]) and not finished.has("f_001", "other")


def test_memory_does_not_grow_with_the_number_of_frames(learned, tmp_path, monkeypatch):
    """Neither frames nor their pictures outlive their turn, and what Python allocates between two turns stays level."""
    sequence = Sequence(learned.project, tmp_path, 160, size=16)
    alive, sizes, render = [], [], Model.render

    def counted(model, *camera):
        frame = render(model, *camera)
        alive.append(weakref.ref(frame.picture))
        if len(alive) in (60, 140):
            gc.collect()
            sizes.append(tracemalloc.get_traced_memory()[0])
        return frame

    monkeypatch.setattr(Model, "render", counted)
    tracemalloc.start()
    try:
        assert len(sequence.render()) == 160
    finally:
        tracemalloc.stop()
    gc.collect()
    assert not [picture for picture in alive if picture() is not None]
    assert sizes[1] - sizes[0] < 80 * 1024  # bytes of 80 frames: one plane of each would be as many
