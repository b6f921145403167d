"""Long sequences: frames that are finished are kept where they would come out the same, and memory does not grow."""

import gc
import json
import tracemalloc
import weakref
from dataclasses import replace

import pytest

from blender_tests.engine.commands.conftest import Events
from blender_tests.engine.commands.farm.sequences import Sequence
from karf_engine.errors import Cancelled
from karf_engine.export.finished_frames import RECORD_NAME, model_fingerprint, view_fingerprint
from karf_engine.recolor.model import Model

ALL = ["frame_0001", "frame_0002", "frame_0003", "frame_0004"]


class Kept(Sequence):
    """A sequence that is rendered into one folder, where its frames are kept."""

    def __init__(self, project, folder, count):
        super().__init__(project, folder, count, size=8)
        self.out = folder / "out"

    def times(self):
        return {path.stem: path.stat().st_mtime_ns for path in (self.out / "recolor").glob("*.png")}

    def render(self, **options):
        """Render what is not there; the names of the frames that were written."""
        before = self.times()
        super().render(self.out, **{"skip_existing": True} | options)
        return sorted(name for name, time in self.times().items() if before.get(name) != time)


@pytest.fixture
def sequence(copy, tmp_path):
    return Kept(copy.folder, tmp_path, 4)


def finish_otherwise(stage):
    """A change of a project: a stage was run again, with other inputs and the same outputs."""

    def change(sequence, project):
        known = project.finished(stage)
        project.finish(stage, "another", folder=known["folder"], files=known["files"])

    return change


def remove_and_cut_off(sequence, project):
    (sequence.out / "recolor" / "frame_0001.png").unlink()
    (sequence.out / "render" / "frame_0003.png").write_bytes(b"\x89PNG")


def damage_note(text):
    def damage(sequence, project):
        note = sequence.out / RECORD_NAME
        lines = note.read_text().split("\n")
        note.write_text(text + "\n".join(lines)[:-40])  # killed while writing the last line

    return damage


def rewrite(sequence, project):
    sequence.edit.write_text(json.dumps(json.loads(sequence.edit.read_text()), indent=4))


CHANGES = {
    "none": (lambda *_: None, []),
    "camera": (lambda sequence, _: sequence.move(2, 1.5), ["frame_0003"]),
    "edit": (lambda sequence, _: sequence.paint((0.05, 0.1, 0.4)), ALL),
    "layout of the edit": (rewrite, []),
    "palettes": (finish_otherwise("recoloring"), ALL),
    "splats": (finish_otherwise("splats"), ALL),
    "frames": (remove_and_cut_off, ["frame_0001", "frame_0003"]),
    "note, cut off": (damage_note(""), ["frame_0004"]),
    "note, other lines": (damage_note("\0\0\n{]\n[]\n7\n"), ["frame_0004"]),
    "note, other frame": (damage_note('{"frame": "frame_0001", "made_from": "x"}\n'), ["frame_0004"]),
}


@pytest.mark.parametrize(("change", "again"), CHANGES.values(), ids=CHANGES)
def test_frames_are_rendered_again_where_something_changed(sequence, copy, change, again):
    assert sequence.render() == ALL
    change(sequence, copy)
    events = Events()
    assert sequence.render(emit=events) == again
    steps = [events.values("progress", name)[-1:] for name in ("step", "total")]
    assert steps == ([[4], [4]] if again else [[], []])  # counted with the frames that were there
    assert sequence.render() == []


def test_frames_are_rendered_again_where_more_or_all_is_asked_for(sequence):
    assert sequence.render() == ALL
    assert sequence.render(depth=True) == ALL and sequence.render(depth=True) == []
    assert sequence.render(skip_existing=False) == ALL


def test_photos_are_recolored_again_where_a_mask_changed_and_other_cameras_are_not(copy):
    photo = Model(copy).capture.split("test")[0]

    def marks_of_views():
        mark = model_fingerprint(copy, Model(copy).settings)
        return view_fingerprint(mark, photo), view_fingerprint(mark, replace(photo, image=None))

    before = marks_of_views()
    assert marks_of_views() == before
    next(copy.masks_folder.rglob("*.png")).unlink()
    after = marks_of_views()
    assert after[0] != before[0] and after[1] == before[1]


def test_a_cancelled_sequence_keeps_its_frames_and_goes_on(sequence):
    asked = iter(range(2))
    with pytest.raises(Cancelled):
        sequence.render(should_stop=lambda: next(asked, None) is None)
    kept = sorted(sequence.times())
    assert kept == ALL[: len(kept)] and 0 < len(kept) < 4
    assert sequence.render() == ALL[len(kept) :]


def test_memory_does_not_grow_with_the_number_of_frames(learned, tmp_path, monkeypatch):
    """Neither frames nor their pictures outlive their turn, and what Python allocates between two turns stays level."""
    sequence = Sequence(learned.project, tmp_path, 100, size=16)
    alive, sizes, render = [], [], Model.render

    def counted(model, *camera):
        frame = render(model, *camera)
        alive.append(weakref.ref(frame.picture))
        if len(alive) in (30, 90):
            gc.collect()
            sizes.append(tracemalloc.get_traced_memory()[0])
        return frame

    monkeypatch.setattr(Model, "render", counted)
    tracemalloc.start()
    try:
        sequence.render(tmp_path / "out")
    finally:
        tracemalloc.stop()
    gc.collect()
    assert len(alive) == 100 and not [picture for picture in alive if picture() is not None]
    assert sizes[1] - sizes[0] < 60 * 1024  # bytes of 60 frames: one plane of each would be as many
