"""A cancelled or killed fit of any kind resumes where it stood, and ends bit by bit where an uninterrupted one does."""

from dataclasses import replace

import pytest

torch = pytest.importorskip("torch")
pytest.importorskip("scipy")

from blender_tests.engine.fields.nerf import test_fit_nerf as nerf
from blender_tests.engine.fields.voxels import test_fit as box
from blender_tests.engine.fields.voxels import test_fit_open as opened
from blender_tests.engine.reference.still_life import cameras, take_photo
from karf_engine.compute.progress import Progress
from karf_engine.compute.runtime import start_runtime
from karf_engine.errors import Cancelled
from karf_engine.fields.fit import CHECKPOINT_SCHEMA, Checkpoint
from karf_engine.fields.rendering.surface_cache import SurfaceCache
from karf_engine.fields.voxels.fit_box import start_box_fit
from karf_engine.heads.fields import RecoloringField, SegmentationField
from karf_engine.heads.fit import ObjectRays, fit_on_points, fit_on_rays, fit_recoloring
from karf_engine.io.checkpoints import load_tensors, save_tensors
from karf_engine.project.settings import Level, RecoloringSettings, SegmentationSettings

BOX = replace(box.SETTINGS, levels=(Level(12, 60, 1.0), Level(16, 12, 1.0)), samples=4000, max_rays=512)
OPEN = replace(
    opened.SETTINGS,
    open=replace(opened.SETTINGS.open, levels=(Level(12, 30, 1.0), Level(16, 8, 1.0)), samples=3000, max_rays=512),
)
NERF = replace(nerf.TINY, iterations=9, look_every=4, width=16, rays=32)


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
    photos = [take_photo(camera, kind == "opaque") for camera in cameras(10)]
    return start_box_fit(box.bank_of(photos, kind), kind, BOX, start_runtime(0, 1, "cpu"))


def start_open():
    return opened.start(cameras(8), "contraction", True, OPEN)


GEOMETRIES = {
    "box, matte": lambda: start_box("alpha"),
    "box, sky": lambda: start_box("opaque"),
    "open": start_open,
    "nerf": lambda: nerf.start("opaque", NERF),
}


def learn_geometry(start, progress, checkpoint):
    """Everything that a scene is made of, after each level."""
    fit = start()
    checkpoint.attach(fit, progress)
    found = []
    for scene in fit.scenes(progress, checkpoint):
        background = {} if scene.background is None else scene.background.state_dict()
        tensors = [*scene.field.state_dict().values(), *background.values()]
        found.append([tensor.clone() for tensor in tensors])
    return found[-1]


class Plain:
    """A field whose features are the positions and their squares."""

    n_features = 6

    @staticmethod
    def features(positions):
        return torch.cat([positions, positions**2], 1)


def learn_head(kind, progress, checkpoint):
    """Everything that a head is made of."""
    runtime = start_runtime(0, 1, "cpu")
    random = torch.Generator().manual_seed(1)
    positions = torch.rand(200, 3, 3, generator=random) * 2 - 1
    classes = (positions[:, 0, 0] > 0).long()
    bounds = torch.tensor([[-1.0] * 3, [1.0] * 3])
    common = (runtime, progress, checkpoint)
    if kind == "recoloring":
        settings = RecoloringSettings(iterations=12, batch=64, width=8, palette_share=0.5)
        karf = RecoloringField(bounds, 6, [3, 3], settings)
        colors, weights = torch.rand(200, 3, generator=random), torch.full((200, 3), 1 / 3)
        everyone = torch.ones(200, dtype=torch.bool)
        rays = ObjectRays(
            positions, positions[:, 0], colors, classes, classes, weights, everyone, torch.ones(len(colors))
        )
        palettes = torch.rand(2, 3, 3, generator=random)
        return [fit_recoloring(karf, Plain, rays, palettes, settings, *common), *karf.state_dict().values()]
    settings = SegmentationSettings(iterations=12, batch=64, width=8)
    karf = SegmentationField(bounds[None], 6, settings)
    if kind == "points":
        certainty, near = torch.ones(200), positions[:, 0, 0].abs() < 0.2
        fit_on_points(karf, Plain, positions[:, 0], classes, certainty, near, classes < 0, settings, *common)
    else:
        cache = SurfaceCache(positions, positions[..., 0], positions[:, 0], torch.ones(200), torch.arange(200))
        fit_on_rays(karf, Plain, cache, torch.eye(2)[classes], settings, *common)
    return list(karf.state_dict().values())


LEARNERS = {name: lambda p, u, start=start: learn_geometry(start, p, u) for name, start in GEOMETRIES.items()}
LEARNERS |= {kind: lambda p, u, kind=kind: learn_head(kind, p, u) for kind in ("points", "rays", "recoloring")}
# early, at the end of the first level, after one pruning, in the midst of the last part, at the very end
STOPS = {"box, matte": (60, 65), "box, sky": (5, 63, 72), "open": (9, 30, 35), "nerf": (3, 4, 6, 9)}
HEAD_STOPS = (4, 9)


@pytest.fixture
def events():
    return []


@pytest.fixture
def checkpoint(tmp_path, events):
    """The file of a fit, opened anew for each job."""
    return lambda fingerprint="of these inputs": Checkpoint(
        tmp_path / "unfinished.safetensors", fingerprint, "test", lambda kind, /, **values: events.append(values)
    )


def same(first, second):
    return len(first) == len(second) and all(torch.equal(a, b) for a, b in zip(first, second, strict=True))


@pytest.mark.parametrize("name", LEARNERS)
def test_a_fit_that_is_cancelled_again_and_again_ends_where_an_uninterrupted_one_does(name, checkpoint, events):
    learn = LEARNERS[name]
    whole = learn(Stopwatch(), checkpoint("uninterrupted"))
    stood = 0
    for stop in STOPS.get(name, HEAD_STOPS):
        progress = Stopwatch(after=stop - stood)
        with pytest.raises(Cancelled):
            learn(progress, checkpoint())
        assert progress.begun_at == stood
        stood = stop
    last = Stopwatch()
    assert same(learn(last, checkpoint()), whole)
    assert f"resuming at iteration {stood} of {stood + last.steps}" in events[-1]["text"]


@pytest.mark.parametrize("name", ["box, sky", "open", "nerf", "recoloring"])
def test_saving_on_the_way_changes_nothing_of_what_is_learned(name, checkpoint, monkeypatch):
    whole = LEARNERS[name](Stopwatch(), checkpoint("uninterrupted"))
    monkeypatch.setattr("karf_engine.fields.fit.CHECKPOINT_INTERVAL", 0.0)
    assert same(LEARNERS[name](Stopwatch(), checkpoint()), whole)


def interrupted(learn, checkpoint, after=3):
    with pytest.raises(Cancelled):
        learn(Stopwatch(after), checkpoint())


def rewrite(path, change):
    """Write the file with other tensors, under a checksum that is right: no damage of the disk, but what a careless hand
    or another program has done."""
    state, facts = load_tensors(path, CHECKPOINT_SCHEMA)
    change(state)
    from karf_engine.fields.fit import _checksum

    save_tensors(path, state, CHECKPOINT_SCHEMA, facts | {"checksum": _checksum(state, facts["notes"])})


DAMAGES = {
    "cut off": lambda path: path.write_bytes(path.read_bytes()[:-100]),
    "no such format": lambda path: path.write_bytes(b"nothing"),
    "an older format": lambda path: save_tensors(
        path, {}, "karf-unfinished-nerf/1", {"fingerprint": "of these inputs"}
    ),
    "one bit": lambda path: path.write_bytes(path.read_bytes()[:-9] + bytes([path.read_bytes()[-9] ^ 4]) + b"\0" * 8),
    "no facts": lambda path: save_tensors(path, {}, CHECKPOINT_SCHEMA, {}),
    "nothing in it": lambda path: rewrite(path, dict.clear),
    "one missing": lambda path: rewrite(path, lambda state: state.pop(min(state))),
    "one too many": lambda path: rewrite(path, lambda state: state.update(more=torch.zeros(2))),
    "other shapes": lambda path: rewrite(path, lambda s: s.update({n: t[None] for n, t in s.items()})),
    "other types": lambda path: rewrite(path, lambda s: s.update({n: t.int() for n, t in s.items()})),
    "not finite": lambda path: rewrite(path, lambda s: s.update({n: t * torch.nan for n, t in s.items()})),
    "no numbers": lambda path: rewrite(path, lambda s: s.update({n: t - 7 for n, t in s.items() if t.dim() == 0})),
}


@pytest.mark.parametrize("damage", DAMAGES)
@pytest.mark.parametrize("name", ["box, sky", "nerf", "recoloring"])
def test_what_is_damaged_is_removed_with_a_warning_and_learning_begins_anew(
    name, damage, checkpoint, tmp_path, events, request
):
    interrupted(LEARNERS[name], checkpoint)
    path = tmp_path / "unfinished.safetensors"
    DAMAGES[damage](path)
    progress = Stopwatch(after=2)
    with pytest.raises(Cancelled):
        LEARNERS[name](progress, checkpoint())
    assert progress.begun_at == 0
    assert [values["code"] for values in events] == ["unfinished"]
    assert "begins anew" in events[0]["sentence"] and str(path) not in events[0].get("text", "")
    # and what is saved from then on is sound
    last = Stopwatch(after=1)
    with pytest.raises(Cancelled):
        LEARNERS[name](last, checkpoint())
    assert last.begun_at == 2


def test_nothing_of_a_damaged_state_is_taken_over(checkpoint, tmp_path):
    learn = LEARNERS["box, sky"]
    whole = learn(Stopwatch(), checkpoint("uninterrupted"))
    interrupted(learn, checkpoint, after=65)
    rewrite(tmp_path / "unfinished.safetensors", lambda state: state.pop("course.random"))
    assert same(learn(Stopwatch(), checkpoint()), whole)


def test_what_other_inputs_left_is_not_resumed(checkpoint, events):
    interrupted(LEARNERS["points"], checkpoint)
    progress = Stopwatch()
    LEARNERS["points"](progress, checkpoint("another fingerprint"))
    assert progress.begun_at == 0 and not events


def test_notes_are_kept_beside_the_fit(checkpoint):
    first = checkpoint()
    first.notes["held_out"] = [[20.5, 19.0]]
    with pytest.raises(Cancelled):
        LEARNERS["points"](Stopwatch(after=3), first)
    second = checkpoint()
    LEARNERS["points"](Stopwatch(), second)
    assert second.notes == {"held_out": [[20.5, 19.0]]}


def test_random_numbers_of_another_kind_of_device_do_not_cost_what_was_learned(checkpoint, tmp_path):
    interrupted(LEARNERS["points"], checkpoint)
    rewrite(tmp_path / "unfinished.safetensors", lambda s: s.update(random=torch.zeros(16, dtype=torch.uint8)))
    progress = Stopwatch()
    LEARNERS["points"](progress, checkpoint())
    assert progress.begun_at == 3


def test_a_disk_that_takes_nothing_is_a_warning_said_once(checkpoint, events, monkeypatch):
    def fail(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("karf_engine.fields.fit.CHECKPOINT_INTERVAL", 0.0)
    monkeypatch.setattr("karf_engine.fields.fit.save_tensors", fail)
    whole = LEARNERS["points"](Stopwatch(), checkpoint())
    assert len(whole) > 3
    assert ["No space left" in values["sentence"] for values in events] == [True]


def test_progress_resumes_where_it_stood_at_its_own_rate():
    events = []
    progress = Progress(lambda kind, **values: events.append(values), lambda: False, "test", 1000)
    progress.resume_at(990)
    progress.step()
    assert (events[0]["step"], events[0]["total"]) == (991, 1000)
    assert events[0]["eta_s"] == pytest.approx(9 / events[0]["rate"], rel=0.2, abs=0.1)
