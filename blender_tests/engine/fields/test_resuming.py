"""A cancelled or killed fit of any kind resumes where it stood, and ends bit by bit where an uninterrupted one does."""

from dataclasses import replace

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
    """Progress that cancels after some steps, and notes where it stood."""

    def __init__(self, after=None):
        super().__init__(lambda *_, **__: None, lambda: after is not None and self.steps >= after, "test", 100)
        self.steps, self.begun_at = 0, 0

    def resume_at(self, done):
        super().resume_at(done)
        self.begun_at = done

    def step(self, count=1, **metrics):
        self.steps += count
        super().step(count, **metrics)


def start_box(kind):
    return box.start([take_photo(camera, kind == "opaque") for camera in cameras(10)], kind, BOX)


def learn_geometry(start, progress, checkpoint):
    fit = start()
    checkpoint.attach(fit, progress)
    found = []
    for scene in fit.scenes(progress, checkpoint):
        background = {} if scene.background is None else scene.background.state_dict()
        tensors = [*scene.field.state_dict().values(), *background.values()]
        found.append([tensor.clone() for tensor in tensors])
    return found[-1]


class Plain:
    n_features = 6

    @staticmethod
    def features(positions):
        return torch.cat([positions, positions**2], 1)


def head(kind, settings):
    return lambda progress, checkpoint: learn_head(
        kind, Plain, settings, start_runtime(0, 1, "cpu"), progress, checkpoint
    )


def geometry(start):
    return lambda progress, checkpoint: learn_geometry(start, progress, checkpoint)


LEARNERS = {  # and where they are stopped: early, at a level's end, after one pruning, in the last part, at the very end
    "box, matte": (geometry(lambda: start_box("alpha")), (60, 65)),
    "box, sky": (geometry(lambda: start_box("opaque")), (5, 63, 72)),
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
    def emit(kind, /, **values):
        events.append(values)

    return lambda fingerprint="of these inputs": Checkpoint(path, fingerprint, "test", emit)


def same(first, second):
    return len(first) == len(second) and all(torch.equal(a, b) for a, b in zip(first, second, strict=True))


def interrupted(learn, checkpoint, after=3):
    """Where the fit began that is cancelled after some steps."""
    progress = Stopwatch(after)
    with pytest.raises(Cancelled):
        learn(progress, checkpoint())
    return progress.begun_at


@pytest.mark.parametrize("name", LEARNERS)
def test_a_resumed_fit_ends_bit_by_bit_where_an_uninterrupted_one_does(name, checkpoint, events, monkeypatch):
    learn, stops = LEARNERS[name]
    whole = learn(Stopwatch(), checkpoint("uninterrupted"))
    stood = 0
    for stop in stops:
        assert interrupted(learn, checkpoint, stop - stood) == stood
        stood = stop
    last = Stopwatch()
    monkeypatch.setattr("karf_engine.fields.fit.CHECKPOINT_INTERVAL", 0.0)  # saving on the way changes nothing
    assert same(learn(last, checkpoint()), whole)
    assert f"resuming at iteration {stood} of {stood + last.steps}" in events[-1]["text"]


def rewrite(change):
    """Write the file with other tensors, under a checksum that is right: no damage of the disk, but what a careless hand
    or another program has done."""

    def write(path):
        state, facts = load_tensors(path, CHECKPOINT_SCHEMA)
        change(state)
        save_tensors(path, state, CHECKPOINT_SCHEMA, facts | {"checksum": _checksum(state, facts["notes"])})

    return write


OLDER = ({}, "karf-unfinished-nerf/1", {"fingerprint": "of these inputs"})
DAMAGES = {
    "cut off": lambda path: path.write_bytes(path.read_bytes()[:-100]),
    "an older format": lambda path: save_tensors(path, *OLDER),
    "one bit": lambda path: path.write_bytes(path.read_bytes()[:-9] + bytes([path.read_bytes()[-9] ^ 4]) + b"\0" * 8),
    "no facts": lambda path: save_tensors(path, {}, CHECKPOINT_SCHEMA, {}),
}
CHANGES = {
    "nothing in it": rewrite(dict.clear),
    "one missing": rewrite(lambda state: state.pop(min(state))),
    "one too many": rewrite(lambda state: state.update(more=torch.zeros(2))),
    "other shapes": rewrite(lambda s: s.update({n: t[None] for n, t in s.items()})),
    "other types": rewrite(lambda s: s.update({n: t.int() for n, t in s.items()})),
    "not finite": rewrite(lambda s: s.update({n: t * torch.nan for n, t in s.items()})),
    "no numbers": rewrite(lambda s: s.update({n: t - 7 for n, t in s.items() if t.dim() == 0})),
}
CASES = [("recoloring", damage) for damage in DAMAGES]
CASES += [(name, change) for name in ("box, sky", "nerf", "recoloring") for change in CHANGES]


@pytest.mark.parametrize(("name", "damage"), CASES)
def test_a_damaged_checkpoint_gives_a_warning_and_a_new_start(name, damage, checkpoint, path, events):
    learn, _ = LEARNERS[name]
    interrupted(learn, checkpoint)
    (DAMAGES | CHANGES)[damage](path)
    assert interrupted(learn, checkpoint, after=2) == 0
    assert [values["code"] for values in events] == ["unfinished"]
    assert "begins anew" in events[0]["sentence"] and str(path) not in events[0].get("text", "")
    assert interrupted(learn, checkpoint, after=1) == 2, "what is saved from then on is sound"


def test_a_damaged_state_changes_nothing(checkpoint, path):
    learn, _ = LEARNERS["box, sky"]
    whole = learn(Stopwatch(), checkpoint("uninterrupted"))
    interrupted(learn, checkpoint, after=65)
    rewrite(lambda state: state.pop("course.random"))(path)
    assert same(learn(Stopwatch(), checkpoint()), whole)


def test_a_checkpoint_of_other_inputs_is_ignored(checkpoint, events):
    interrupted(POINTS, checkpoint)
    progress = Stopwatch()
    POINTS(progress, checkpoint("another fingerprint"))
    assert progress.begun_at == 0 and not events


def test_notes_are_kept_beside_the_fit(checkpoint):
    first, second = checkpoint(), checkpoint()
    first.notes["held_out"] = [[20.5, 19.0]]
    interrupted(POINTS, lambda: first)
    POINTS(Stopwatch(), second)
    assert second.notes == {"held_out": [[20.5, 19.0]]}


def test_a_fit_of_another_device_resumes_with_new_random_numbers(checkpoint, path):
    interrupted(POINTS, checkpoint)
    rewrite(lambda s: s.update(random=torch.zeros(16, dtype=torch.uint8)))(path)
    progress = Stopwatch()
    POINTS(progress, checkpoint())
    assert progress.begun_at == 3


def test_a_full_disk_gives_one_warning(checkpoint, events, monkeypatch):
    def fail(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("karf_engine.fields.fit.CHECKPOINT_INTERVAL", 0.0)
    monkeypatch.setattr("karf_engine.fields.fit.save_tensors", fail)
    assert len(POINTS(Stopwatch(), checkpoint())) > 3
    assert ["No space left" in values["sentence"] for values in events] == [True]


def test_progress_resumes_where_it_stood_at_its_own_rate():
    events = []
    progress = Progress(lambda kind, **values: events.append(values), lambda: False, "test", 1000)
    progress.resume_at(990)
    progress.step()
    assert (events[0]["step"], events[0]["total"]) == (991, 1000)
    assert events[0]["eta_s"] == pytest.approx(9 / events[0]["rate"], rel=0.2, abs=0.1)
