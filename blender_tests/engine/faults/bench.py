"""A tiny project in each of its valid states, to check that a fault leaves it in one of them.

Each finished stage stores a fingerprint of its inputs; the chain of these identifies a state. Every valid state is made
once without faults, so a project with that chain must hold exactly its files and render exactly its pictures. A mixture
of an old and a new generation matches none.
"""

from __future__ import annotations

import hashlib
import json
import shutil
import time
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import numpy as np

from blender_tests.engine.faults.engine import Run, run
from blender_tests.engine.faults.traps import record_changes
from blender_tests.engine.reference.still_life import write_capture, write_masks
from karf_engine.errors import KarfError
from karf_engine.project import STAGE_ORDER, Project

SIZE, N_PHOTOS = 36, 8
MASKED_VIEWS = ("r_0", "r_4")
SETTINGS = """
    geometry.space=box geometry.long_side=36 geometry.samples=6000 geometry.max_rays=512 geometry.features=6
    geometry.levels=[{"voxels":16,"iterations":60,"step":1.0},{"voxels":24,"iterations":25,"step":1.0}]
    geometry.table_rate=0.3 geometry.network_rate=0.02 geometry.sparsity=0.0 geometry.prune_alpha=0.001
    geometry.prune_visibility=0.005
    segmentation.iterations=40 segmentation.rate=0.03 segmentation.batch=256 segmentation.width=8
    segmentation.cache_views=6 segmentation.cache_long_side=36
    recoloring.iterations=15 recoloring.width=8 recoloring.batch=128
    splats.iterations=12 splats.count=1000 splats.long_side=32 splats.degree=1
""".split()
CHANGES = {  # overrides that make each stage run again; segmentation gets other masks
    "geometry": ("seed=1", "geometry.long_side=32"),
    "segmentation": (),
    "palette": ("palette.colors=4",),
    "recoloring": ("recoloring.iterations=20",),
    "splats": ("splats.iterations=15",),
}
PASSING = ("project.json", "preview.png", "lock", "lock.json")  # not results of a stage
PASSING_FOLDERS = ("earlier_masks", "masks", "planes", "photos", "jobs", "out", "results")


@dataclass(frozen=True)
class State:
    """A valid state. chain: (stage, fingerprint) of each finished stage; files and pictures: digests by name."""

    chain: tuple[tuple[str, str], ...]
    folder: Path
    files: dict[str, str]
    pictures: dict[str, str]


@dataclass(frozen=True)
class Scenario:
    """One run of a stage, first or repeated. start: the project before it; end: the state that it leads to."""

    title: str
    start: Path | None
    command: list[str]
    end: State
    seconds: float


@dataclass
class Bench:
    """The workspace of all faults, which strike the folder `project`."""

    folder: Path
    states: dict[tuple, State] = field(default_factory=dict)
    scenarios: list[Scenario] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.capture, self.masks, self.other_masks = (self.folder / n for n in ("capture", "masks", "other_masks"))
        self.project, self.look = self.folder / "project", self.folder / "look"
        photos = write_capture(self.capture, N_PHOTOS, 2, SIZE)
        write_masks(self.masks, photos, MASKED_VIEWS)
        write_masks(self.other_masks, photos, ("r_2", "r_6"))
        self._make_states()

    def command(self, stage: str, changed: bool = False, settings_of: str = "geometry") -> list[str]:
        """The command line of a stage, as first run or changed. settings_of: the stage whose changes geometry sets."""
        source, options = self.project, []
        if stage == "geometry":
            overrides = [*SETTINGS, *(CHANGES[settings_of] if changed else ())]
            source = self.capture
            options = ["--project", str(self.project), *(part for text in overrides for part in ("--set", text))]
        elif stage == "segmentation":
            options = ["--masks", str(self.other_masks if changed else self.masks)]
        return [stage, str(source), *options, "--threads", "1"]

    def render(self, *more: str) -> list[str]:
        """Render one held-out view into the folder `look`."""
        return ["render", str(self.project), "--views", "test_r_0", "--out", str(self.look), "--threads", "1", *more]

    @property
    def match(self) -> list[str]:
        """Match an edit into the folder `look`."""
        colors = ["--object", "ball", "--from", "#b5302c", "--to", "#3059b8"]
        return ["match", str(self.project), *colors, "--out", str(self.look / "edit.json")]

    def _make_states(self) -> None:
        """Make all valid states, and the scenarios that lead from one to another."""
        start = None
        for stage in STAGE_ORDER:
            self._add(f"{stage}, first", start, self.command(stage))
            start = self.scenarios[-1].end.folder
        self.complete = self.scenarios[-1].end
        self._run_checked(self.match)
        self.edit = digest(self.look / "edit.json")
        for stage in STAGE_ORDER:
            start = self.complete.folder
            if stage in ("palette", "recoloring", "splats"):  # the changed settings are stored first
                self.restore(start)
                self._run_checked(self.command("geometry", True, stage))
                start = self._snapshot(f"{stage} to run again")
            self._add(f"{stage}, again", start, self.command(stage, True))
        start = self.complete.folder
        self.restore(start)
        seconds = self._run_checked(self.render("--planes"))
        self.scenarios.append(Scenario("render", start, self.render("--planes"), self.complete, seconds))

    def _add(self, title: str, start: Path | None, command: list[str]) -> None:
        self.restore(start)
        seconds = self._run_checked(command)
        chain, files, folder = self.chain(), self.files(), self._snapshot(title)
        pictures, rendered = self.pictures()
        if rendered.code:
            raise RuntimeError(rendered.text)
        self.states[chain] = State(chain, folder, files, pictures)
        self.scenarios.append(Scenario(title, start, command, self.states[chain], seconds))

    def _run_checked(self, command: list[str]) -> float:
        """Run a command, which must succeed; returns its seconds."""
        begin = time.monotonic()
        done = run(command)
        if done.code:
            raise RuntimeError(f"{' '.join(command[:2])} fails without any fault:\n{done.text}")
        return time.monotonic() - begin

    def _snapshot(self, name: str) -> Path:
        return shutil.copytree(self.project, self.folder / "states" / name.replace(", ", "_").replace(" ", "_"))

    def restore(self, start: Path | None) -> None:
        """Replace the project by a copy of this one; None: by nothing."""
        if self.project.is_symlink():
            self.project.unlink()
        shutil.rmtree(self.project, ignore_errors=True)
        if start is not None:
            shutil.copytree(start, self.project)

    def rerun(self, stage: str) -> Scenario:
        """The scenario in which this stage runs again."""
        return next(scenario for scenario in self.scenarios if scenario.title == f"{stage}, again")

    def some(self, few: bool) -> list[Scenario]:
        """All scenarios, or the one with the most changes of files for its seconds."""
        return [self.rerun("segmentation")] if few else self.scenarios

    def repeated(self, few: bool) -> list[Scenario]:
        """Scenarios that begin with a complete project, where old and new could mix."""
        return [scenario for scenario in self.some(few) if not scenario.title.endswith("first")]

    def chain(self) -> tuple[tuple[str, str], ...]:
        """The finished stages with their fingerprints. Raises KarfError where the project does not open."""
        stages = Project(self.project).state()["stages"]
        return tuple((stage, stages[stage]["fingerprint"]) for stage in STAGE_ORDER if stage in stages)

    def files(self) -> dict[str, str]:
        """Digests of the stages' results, `<stage>/<file>`, and of other lasting files."""
        names = (path.relative_to(self.project) for path in sorted(self.project.rglob("*")) if path.is_file())
        own = [name for name in names if str(name) not in PASSING and name.parts[0] not in PASSING_FOLDERS]
        results = [f"{stage}/{name}" for stage, summary in self._stages().items() for name in summary["files"]]
        digests = {str(name): digest(self.path(str(name))) for name in (*own, *results)}
        try:
            masks = Project(self.project).masks_folder
        except KarfError:
            masks = self.project / "masks"
        drawn = sorted(masks.rglob("*.png")) if masks.is_dir() else []
        return digests | {f"masks/{path.relative_to(masks).as_posix()}": digest(path) for path in drawn}

    def path(self, name: str) -> Path:
        """Return the path of one of `files`."""
        stage, _, file = name.partition("/")
        if stage in STAGE_ORDER:
            return self.project / "results" / self._stages()[stage]["folder"] / file
        return self.project / name

    def _stages(self) -> dict:
        """Summaries of the finished stages, whatever the schema of project.json."""
        state_file = self.project / "project.json"
        return json.loads(state_file.read_text())["stages"] if state_file.exists() else {}

    def differences(self, state: State, except_for: str = "") -> list[str]:
        """The files of a state that the project lacks or holds with other content."""
        files = self.files()
        return [name for name, own in state.files.items() if files.get(name) != own and name != except_for]

    def pictures(self, planes: bool | None = None) -> tuple[dict[str, str], Run]:
        """Digests of a render's files, and the render. planes: None renders them where the project has them."""
        shutil.rmtree(self.look, ignore_errors=True)
        self.look.mkdir()
        planes = "recoloring" in dict(self.chain()) if planes is None else planes
        rendered = run(self.render(*(["--planes"] if planes else [])))
        # finished.jsonl depends on the options of a render, pixels do not
        paths = [path for path in sorted(self.look.rglob("*")) if path.is_file() and path.name != "finished.jsonl"]
        return {str(path.relative_to(self.look)): digest(path) for path in paths}, rendered

    def changes(self, scenario: Scenario, flushes: bool) -> list[str]:
        """The file changes of a scenario, in order."""
        self.restore(scenario.start)
        record = self.folder / "changes.txt"
        run(scenario.command, partial(record_changes, self.project, record, flushes))
        return record.read_text().splitlines()

    def assert_survives(self, scenario: Scenario, ended: Run | None = None, exact: bool = True) -> None:
        """Assert that nothing is lost after a fault, which `ended` the command, and that the same command completes it.

        exact: False where a stage was finished in smaller batches, which sum up in another order.
        """
        self.assert_valid(exact)
        assert ended is None or ended.flaw is None
        done = run(scenario.command)
        assert done.code == 0, done.text
        assert self.chain() == scenario.end.chain
        self.assert_valid(exact)
        start = scenario.start
        before = {str(path.relative_to(start)) for path in start.rglob("*")} if start else set()
        new = set(self.files()) - set(scenario.end.files) - before
        assert {name for name in new if Path(name).parts[0] != "looks"} == set()  # a cache, which renders fill

    def assert_valid(self, exact: bool = True) -> None:
        """Assert that the project is in a valid state or was never begun."""
        if not (self.project / "project.json").exists() or not self.chain():
            return
        state = self.states[self.chain()]
        assert not exact or not self.differences(state)
        pictures, rendered = self.pictures()
        assert rendered.code == 0, rendered.text
        assert not exact or pictures == state.pictures


def digest(path: Path) -> str:
    """Digest of a file's content, independent of the order of tensors in its header."""
    data = path.read_bytes()
    try:
        if path.suffix == ".safetensors":
            end = 8 + int.from_bytes(data[:8], "little")
            data = json.dumps(json.loads(data[8:end]), sort_keys=True).encode() + data[end:]
        elif path.suffix == ".npz":  # its members have timestamps
            with np.load(path, allow_pickle=False) as arrays:
                data = b"".join(name.encode() + arrays[name].tobytes() for name in sorted(arrays.files))
    except Exception:  # damaged on purpose
        data = b"damaged" + data
    return hashlib.sha256(data).hexdigest()[:16]
