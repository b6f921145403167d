"""Long sequences keep finished frames that would come out the same, and need constant memory."""

import gc
import json
import tracemalloc
import weakref
from dataclasses import replace
from functools import partial

import pytest

from blender_tests.engine.commands.conftest import Events
from blender_tests.engine.commands.farm.sequences import Sequence
from karf_engine.errors import Cancelled
from karf_engine.export.finished_frames import RECORD_NAME, model_fingerprint, view_fingerprint
from karf_engine.recolor.model import Model

FRAMES = ["frame_0001", "frame_0002", "frame_0003", "frame_0004"]


class SequenceInFolder(Sequence):
    """A sequence that is rendered into one folder."""

    def __init__(self, project, folder, count):
        super().__init__(project, folder, count, size=8)
        self.out = folder / "out"

    def times(self):
        return {path.stem: path.stat().st_mtime_ns for path in (self.out / "recolor").glob("*.png")}

    def render(self, **options):
        """Render missing frames; returns the names of those that were written."""
        before = self.times()
        super().render(self.out, **{"skip_existing": True} | options)
        return sorted(name for name, time in self.times().items() if before.get(name) != time)


def test_edits_with_their_own_file_names_share_a_folder(sequence):
    times = []
    for look, color in (("red", (0.8, 0.1, 0.1)), ("blue", (0.1, 0.1, 0.8)), ("red", (0.8, 0.1, 0.1))):
        sequence.paint(color)
        sequence.render(names=f"{look}/{{frame}}")
        times.append({path.name: path.stat().st_mtime_ns for path in sequence.out.glob("red/*.png")})
    assert times[0] == times[1] == times[2] and sorted(times[0]) == [f"000{number}.png" for number in (1, 2, 3, 4)]
    assert len({path.read_bytes() for path in sequence.out.glob("*/0001.png")}) == 2 and not sequence.times()


@pytest.fixture
def sequence(copy, tmp_path):
    return SequenceInFolder(copy.folder, tmp_path, 4)


def finish_otherwise(stage, _, project):
    """Finish a stage again with other inputs and the same outputs."""
    known = project.finished(stage)
    project.finish(stage, "another", folder=known["folder"], files=known["files"])


def remove_and_truncate(sequence, _):
    (sequence.out / "recolor" / "frame_0001.png").unlink()
    (sequence.out / "render" / "frame_0003.png").write_bytes(b"\x89PNG")


def damage_record(text, sequence, _):
    record = sequence.out / RECORD_NAME
    record.write_text(text + record.read_text()[:-40])  # killed while writing the last line


def reformat_edit(sequence, _):
    sequence.edit.write_text(json.dumps(json.loads(sequence.edit.read_text()), indent=4))


CHANGES = {
    "none": (lambda *_: None, []),
    "camera": (lambda sequence, _: sequence.move(2, 1.5), ["frame_0003"]),
    "edit": (lambda sequence, _: sequence.paint((0.05, 0.1, 0.4)), FRAMES),
    "layout of the edit": (reformat_edit, []),
    "palettes": (partial(finish_otherwise, "recoloring"), FRAMES),
    "splats": (partial(finish_otherwise, "splats"), FRAMES),
    "frames": (remove_and_truncate, ["frame_0001", "frame_0003"]),
    "truncated record": (partial(damage_record, ""), ["frame_0004"]),
    "record with other lines": (partial(damage_record, "\0\0\n{]\n[]\n7\n"), ["frame_0004"]),
    "record of another frame": (partial(damage_record, '{"frame": "frame_0001", "made_from": "x"}\n'), ["frame_0004"]),
}


@pytest.mark.parametrize(("change", "again"), CHANGES.values(), ids=CHANGES)
def test_only_changed_frames_are_rendered_again(sequence, copy, change, again):
    assert sequence.render() == FRAMES
    change(sequence, copy)
    events = Events()
    assert sequence.render(emit=events) == again
    steps = [events.values("progress", name)[-1:] for name in ("step", "total")]
    assert steps == ([[4], [4]] if again else [[], []])  # existing frames count
    assert sequence.render() == []


def test_further_outputs_or_full_render_repeat_all_frames(sequence):
    assert sequence.render() == FRAMES
    assert sequence.render(depth=True) == FRAMES and sequence.render(depth=True) == []
    assert sequence.render(skip_existing=False) == FRAMES


def test_changed_mask_changes_fingerprints_of_photos_only(copy):
    photo = Model(copy).capture.split("test")[0]

    def fingerprints():
        of_model = model_fingerprint(copy, Model(copy).settings)
        return view_fingerprint(of_model, photo), view_fingerprint(of_model, replace(photo, image=None))

    before = fingerprints()
    assert fingerprints() == before
    next(copy.masks_folder.rglob("*.png")).unlink()
    after = fingerprints()
    assert after[0] != before[0] and after[1] == before[1]


def test_cancelled_sequence_resumes_after_its_frames(sequence):
    asked = iter(range(2))
    with pytest.raises(Cancelled):
        sequence.render(should_stop=lambda: next(asked, None) is None)
    kept = sorted(sequence.times())
    assert kept == FRAMES[: len(kept)] and 0 < len(kept) < 4
    assert sequence.render() == FRAMES[len(kept) :]


def test_memory_does_not_grow_with_the_number_of_frames(learned, tmp_path, monkeypatch):
    """No frame or picture outlives its turn, and Python's allocations stay level."""
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
    assert sizes[1] - sizes[0] < 60 * 1024  # one plane of each of the 60 frames between
