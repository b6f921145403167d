"""A cancelled or killed fit of any kind resumes where it stopped and ends with identical bits."""

from dataclasses import replace
from types import SimpleNamespace

import pytest
import torch

from blender_tests.engine.fields.fitting import learn_head
from blender_tests.engine.fields.nerf import test_fit_nerf as nerf
from blender_tests.engine.fields.voxels import test_fit as box
from blender_tests.engine.fields.voxels import test_fit_open as opened
from blender_tests.engine.reference.still_life import cameras, take_photo
from karf_engine.compute.progress import Progress
from karf_engine.compute.runtime import start_runtime
from karf_engine.errors import Cancelled
from karf_engine.fields.fit import CHECKPOINT_SCHEMA, Checkpoint, _checksum
from karf_engine.io.checkpoints import load_tensors, save_tensors
from karf_engine.project.settings import Level, RecoloringSettings, SegmentationSettings

BOX = replace(box.SETTINGS, levels=(Level(12, 60, 1.0), Level(16, 12, 1.0)), samples=4000, max_rays=512)
OPEN = opened.open_settings(Level(12, 30, 1.0), Level(16, 8, 1.0))
NERF = replace(nerf.TINY, iterations=9, look_every=4, width=16, rays=32)
SEGMENTATION = SegmentationSettings(iterations=12, batch=64, width=8)
RECOLORING = RecoloringSettings(iterations=12, batch=64, width=8, palette_share=0.5)


class Stopwatch(Progress):
    """Progress that cancels after some steps and records where it began."""

    def __init__(self, after=None):
        super().__init__(lambda *_, **__: None, lambda: after is not None and self.steps >= after, "test", 100)
        self.steps, self.began_at = 0, 0

    def resume_at(self, done):
        super().resume_at(done)
        self.began_at = done

    def step(self, count=1, **metrics):
        self.steps += count
        super().step(count, **metrics)


def geometry(start):
    def learn(progress, checkpoint):
        fit = start()
        checkpoint.attach(fit, progress)
        for scene in fit.scenes(progress, checkpoint):
            background = {} if scene.background is None else scene.background.state_dict()
            tensors = [tensor.clone() for tensor in (*scene.field.state_dict().values(), *background.values())]
        return tensors

    return learn


def box_geometry(kind):
    return geometry(lambda: box.start([take_photo(c, kind == "opaque") for c in cameras(10)], kind, BOX))


FIELD = SimpleNamespace(n_features=6, features=lambda positions: torch.cat([positions, positions**2], 1))


def head(kind, settings):
    return lambda *tools: learn_head(kind, FIELD, settings, start_runtime(0, 1, "cpu"), *tools)


LEARNERS = {  # with the iterations to stop at: early, at a level's end, after one pruning, in the last part, at the end
    "box, matte": (box_geometry("alpha"), (60, 65)),
    "box, sky": (box_geometry("opaque"), (5, 63, 72)),
    "open": (geometry(lambda: opened.start(cameras(8), "contraction", True, OPEN)), (9, 30, 35)),
    "nerf": (geometry(lambda: nerf.start("opaque", NERF)), (3, 4, 6, 9)),
    "points": (head("points", SEGMENTATION), (4, 9)),
    "rays": (head("rays", SEGMENTATION), (4, 9)),
    "recoloring": (head("recoloring", RECOLORING), (4, 9)),
}
POINTS = LEARNERS["points"][0]


@pytest.fixture
def events():
    return []


@pytest.fixture
def path(tmp_path):
    return tmp_path / "unfinished.safetensors"


@pytest.fixture
def checkpoint(path, events):
    return lambda fingerprint="these inputs": Checkpoint(
        path, fingerprint, "test", lambda kind, **values: events.append(values)
    )


def assert_identical(tensors, expected):
    assert len(tensors) == len(expected)
    assert all(torch.equal(a, b) for a, b in zip(tensors, expected, strict=True))


def interrupt(learn, checkpoint, after=3):
    """Cancel a fit after some steps; return its first iteration."""
    progress = Stopwatch(after)
    with pytest.raises(Cancelled):
        learn(progress, checkpoint())
    return progress.began_at


@pytest.mark.parametrize("name", LEARNERS)
def test_resumed_fit_matches_an_uninterrupted_one_bit_by_bit(name, checkpoint, events, monkeypatch):
    learn, stops = LEARNERS[name]
    uninterrupted = learn(Stopwatch(), checkpoint("uninterrupted"))
    done = 0
    for stop in stops:
        assert interrupt(learn, checkpoint, stop - done) == done
        done = stop
    last = Stopwatch()
    monkeypatch.setattr("karf_engine.fields.fit.CHECKPOINT_INTERVAL", 0.0)  # saving often changes nothing
    assert_identical(learn(last, checkpoint()), uninterrupted)
    assert f"resuming at iteration {done} of {done + last.steps}" in events[-1]["text"]


def rewrite(change):
    """Change the tensors of a file and give it the right checksum, as another program might."""

    def write(path):
        state, facts = load_tensors(path, CHECKPOINT_SCHEMA)
        change(state)
        save_tensors(path, state, CHECKPOINT_SCHEMA, facts | {"checksum": _checksum(state, facts["notes"])})

    return write


DAMAGES = {
    "cut off": lambda path: path.write_bytes(path.read_bytes()[:-100]),
    "old format": lambda path: save_tensors(path, {}, "karf-unfinished-nerf/1", {"fingerprint": "these inputs"}),
    "one bit": lambda path: path.write_bytes(path.read_bytes()[:-9] + bytes([path.read_bytes()[-9] ^ 4]) + b"\0" * 8),
    "no facts": lambda path: save_tensors(path, {}, CHECKPOINT_SCHEMA, {}),
}
CHANGES = {
    "no tensors": rewrite(dict.clear),
    "one missing": rewrite(lambda state: state.pop(min(state))),
    "one too many": rewrite(lambda state: state.update(more=torch.zeros(2))),
    "other shapes": rewrite(lambda s: s.update({n: t[None] for n, t in s.items()})),
    "other types": rewrite(lambda s: s.update({n: t.int() for n, t in s.items()})),
    "not finite": rewrite(lambda s: s.update({n: t * torch.nan for n, t in s.items()})),
    "negative counts": rewrite(lambda s: s.update({n: t - 7 for n, t in s.items() if t.dim() == 0})),
}
CASES = [("recoloring", damage) for damage in DAMAGES]
CASES += [(name, change) for name in ("box, sky", "nerf", "recoloring") for change in CHANGES]


@pytest.mark.parametrize(("name", "damage"), CASES)
def test_damaged_checkpoint_warns_and_starts_over(name, damage, checkpoint, path, events):
    learn = LEARNERS[name][0]
    interrupt(learn, checkpoint)
    (DAMAGES | CHANGES)[damage](path)
    assert interrupt(learn, checkpoint, after=2) == 0
    assert [values["code"] for values in events] == ["unfinished"]
    assert "begins anew" in events[0]["sentence"] and str(path) not in events[0].get("text", "")
    assert interrupt(learn, checkpoint, after=1) == 2, "the new checkpoint is sound"


def test_fit_after_a_damaged_checkpoint_matches_a_fresh_one(checkpoint, path):
    learn = LEARNERS["box, sky"][0]
    uninterrupted = learn(Stopwatch(), checkpoint("uninterrupted"))
    interrupt(learn, checkpoint, after=65)
    rewrite(lambda state: state.pop("course.random"))(path)
    assert_identical(learn(Stopwatch(), checkpoint()), uninterrupted)


def test_checkpoint_of_other_inputs_is_ignored(checkpoint, events):
    interrupt(POINTS, checkpoint)
    POINTS(progress := Stopwatch(), checkpoint("another fingerprint"))
    assert progress.began_at == 0 and not events


def test_notes_are_kept_with_the_checkpoint(checkpoint):
    first, second = checkpoint(), checkpoint()
    first.notes["held_out"] = [[20.5, 19.0]]
    interrupt(POINTS, lambda: first)
    POINTS(Stopwatch(), second)
    assert second.notes == {"held_out": [[20.5, 19.0]]}


def test_fit_of_another_device_resumes_with_new_random_numbers(checkpoint, path):
    interrupt(POINTS, checkpoint)
    rewrite(lambda s: s.update(random=torch.zeros(16, dtype=torch.uint8)))(path)
    POINTS(progress := Stopwatch(), checkpoint())
    assert progress.began_at == 3


def test_full_disk_gives_one_warning(checkpoint, events, monkeypatch):
    def fail(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("karf_engine.fields.fit.CHECKPOINT_INTERVAL", 0.0)
    monkeypatch.setattr("karf_engine.fields.fit.save_tensors", fail)
    assert len(POINTS(Stopwatch(), checkpoint())) > 3
    assert ["No space left" in values["sentence"] for values in events] == [True]
