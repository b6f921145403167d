"""A tiny project in every state it can rightly be in, and the question after a fault: is it in one of these?

Each finished stage notes a fingerprint of its inputs. The chain of these names a state; every right state has been
made once without faults, so a project that claims a chain must hold exactly its files and show exactly its pictures. A
mixture of an old and a new generation matches none.
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
CHANGES = {  # what makes each stage be learned anew; segmentation is given other masks
    "geometry": ("seed=1", "geometry.long_side=32"),
    "segmentation": (),
    "palette": ("palette.colors=4",),
    "recoloring": ("recoloring.iterations=20",),
    "splats": ("splats.iterations=15",),
}
PASSING = ("project.json", "preview.png", "lock", "lock.json")  # files that are not results of a stage
PASSING_FOLDERS = ("earlier_masks", "masks", "planes", "photos", "jobs", "out", "results")


@dataclass(frozen=True)
class State:
    """A right state. chain: (stage, fingerprint) of what is finished; files and pictures: digests by name."""

    chain: tuple[tuple[str, str], ...]
    folder: Path
    files: dict[str, str]
    pictures: dict[str, str]


@dataclass(frozen=True)
class Scenario:
    """One stage that is learned for the first time, or anew. start: the project before; end: what it leads to."""

    title: str
    start: Path | None
    command: list[str]
    end: State
    seconds: float


@dataclass
class Bench:
    """The workspace of all faults. project is the folder that faults are thrown at."""

    folder: Path
    states: dict[tuple, State] = field(default_factory=dict)
    scenarios: list[Scenario] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.capture, self.masks, self.other_masks = (self.folder / n for n in ("capture", "masks", "other_masks"))
        self.project, self.look = self.folder / "project", self.folder / "look"
        photos = write_capture(self.capture, N_PHOTOS, 2, SIZE)
        write_masks(self.masks, photos, MASKED_VIEWS)
        write_masks(self.other_masks, photos, ("r_2", "r_6"))
        self._learn()

    def command(self, stage: str, changed: bool = False, settings_of: str = "geometry") -> list[str]:
        """The command line of a stage, of the first learning or changed. settings_of: whose settings geometry gets."""
        common = ["--threads", "1"]
        if stage == "geometry":
            own = [*SETTINGS, *(CHANGES[settings_of] if changed else ())]
            settings = [part for text in own for part in ("--set", text)]
            return ["geometry", str(self.capture), "--project", str(self.project), *settings, *common]
        if stage == "segmentation":
            masks = self.other_masks if changed else self.masks
            return ["segmentation", str(self.project), "--masks", str(masks), *common]
        return [stage, str(self.project), *common]

    def render(self, *more: str) -> list[str]:
        """Render one held-out view into the folder `look`."""
        return ["render", str(self.project), "--views", "test_r_0", "--out", str(self.look), "--threads", "1", *more]

    @property
    def match(self) -> list[str]:
        """Solve an edit into the folder `look`."""
        colors = ["--object", "ball", "--from", "#b5302c", "--to", "#3059b8"]
        return ["match", str(self.project), *colors, "--out", str(self.look / "edit.json")]

    def _learn(self) -> None:
        """Make all right states, and the scenarios that lead from one to another."""
        start = None
        for stage in STAGE_ORDER:
            self._add(f"{stage}, first", start, self.command(stage))
            start = self.scenarios[-1].end.folder
        self.complete = self.scenarios[-1].end
        self._must(self.match)
        self.edit = digest(self.look / "edit.json")
        for stage in STAGE_ORDER:
            start = self.complete.folder
            if stage in ("palette", "recoloring", "splats"):  # only the settings change before
                self.restore(start)
                self._must(self.command("geometry", True, stage))
                start = self._snapshot(f"{stage} to be learned anew")
            self._add(f"{stage}, anew", start, self.command(stage, True))
        self.restore(self.complete.folder)
        seconds = self._must(self.render("--planes"))
        start = self.complete.folder
        self.scenarios.append(Scenario("render", start, self.render("--planes"), self.complete, seconds))

    def _add(self, title: str, start: Path | None, command: list[str]) -> None:
        self.restore(start)
        seconds = self._must(command)
        chain, files, folder = self.chain(), self.files(), self._snapshot(title)
        pictures, shown = self.pictures()
        if shown.code:
            raise RuntimeError(shown.text)
        self.states[chain] = State(chain, folder, files, pictures)
        self.scenarios.append(Scenario(title, start, command, self.states[chain], seconds))

    def _must(self, command: list[str]) -> float:
        """Run a command, which must succeed; returns its seconds."""
        begin = time.monotonic()
        done = run(command)
        if done.code:
            raise RuntimeError(f"{' '.join(command[:2])} fails without any fault:\n{done.text}")
        return time.monotonic() - begin

    def _snapshot(self, name: str) -> Path:
        return shutil.copytree(self.project, self.folder / "states" / name.replace(", ", "_").replace(" ", "_"))

    def restore(self, start: Path | None) -> None:
        """Put the project into this state; None: there is none yet."""
        if self.project.is_symlink():
            self.project.unlink()
        shutil.rmtree(self.project, ignore_errors=True)
        if start is not None:
            shutil.copytree(start, self.project)

    def anew(self, stage: str) -> Scenario:
        """The scenario in which this stage is learned anew."""
        return next(scenario for scenario in self.scenarios if scenario.title == f"{stage}, anew")

    def some(self, few: bool) -> list[Scenario]:
        """All scenarios, or the one stage in which most happens for its seconds."""
        return [self.anew("segmentation")] if few else self.scenarios

    def repeated(self, few: bool) -> list[Scenario]:
        """Those that begin with a complete project: old and new must not mix."""
        return [scenario for scenario in self.some(few) if not scenario.title.endswith("first")]

    def chain(self) -> tuple[tuple[str, str], ...]:
        """The finished stages with their fingerprints. Raises KarfError where the project does not open."""
        stages = Project(self.project).state()["stages"]
        return tuple((stage, stages[stage]["fingerprint"]) for stage in STAGE_ORDER if stage in stages)

    def files(self) -> dict[str, str]:
        """Digests of the stages' results, `<stage>/<file>`, and of other files that last."""
        names = (path.relative_to(self.project) for path in sorted(self.project.rglob("*")) if path.is_file())
        own = [name for name in names if str(name) not in PASSING and name.parts[0] not in PASSING_FOLDERS]
        results = [f"{stage}/{name}" for stage, summary in self._stages().items() for name in summary["files"]]
        found = {str(name): digest(self.path(str(name))) for name in (*own, *results)}
        try:
            masks = Project(self.project).masks_folder
        except KarfError:
            masks = self.project / "masks"
        marks = sorted(masks.rglob("*.png")) if masks.is_dir() else []
        return found | {f"masks/{path.relative_to(masks).as_posix()}": digest(path) for path in marks}

    def path(self, name: str) -> Path:
        """Return the path of one of `files`."""
        stage, _, file = name.partition("/")
        is_result = stage in STAGE_ORDER
        return self.project / "results" / self._stages()[stage]["folder"] / file if is_result else self.project / name

    def _stages(self) -> dict:
        """Summaries of the finished stages, whatever the schema of project.json."""
        state_file = self.project / "project.json"
        return json.loads(state_file.read_text())["stages"] if state_file.exists() else {}

    def differs(self, state: State, but: str = "") -> list[str]:
        """Which of a state's files, but this one, the project does not hold as they are there."""
        files = self.files()
        return [name for name, own in state.files.items() if files.get(name) != own and name != but]

    def pictures(self, planes: bool | None = None) -> tuple[dict[str, str], Run]:
        """Digests of all that a render gives, and the render. planes: None for where they can be had."""
        shutil.rmtree(self.look, ignore_errors=True)
        self.look.mkdir()
        planes = "recoloring" in dict(self.chain()) if planes is None else planes
        shown = run(self.render(*(["--planes"] if planes else [])))
        # what frames were made from differs with the options of a render, their pixels do not
        paths = [path for path in sorted(self.look.rglob("*")) if path.is_file() and path.name != "finished.jsonl"]
        return {str(path.relative_to(self.look)): digest(path) for path in paths}, shown

    def changes(self, scenario: Scenario, flushes: bool) -> list[str]:
        """The changes of files that a scenario makes, in order."""
        self.restore(scenario.start)
        record = self.folder / "changes.txt"
        run(scenario.command, partial(record_changes, self.project, record, flushes))
        return record.read_text().splitlines()

    def survives(self, scenario: Scenario, ended: Run | None = None, exact: bool = True) -> None:
        """Assert what holds after every fault, which `ended` in some way: nothing is lost, the same command completes it.

        exact: False where a stage was finished in smaller batches, which sum up in another order.
        """
        self.is_right(exact)
        assert ended is None or ended.flaw is None
        done = run(scenario.command)
        assert done.code == 0, done.text
        assert self.chain() == scenario.end.chain
        self.is_right(exact)
        start = scenario.start
        before = {str(path.relative_to(start)) for path in start.rglob("*")} if start else set()
        new = set(self.files()) - set(scenario.end.files) - before
        assert {name for name in new if Path(name).parts[0] != "looks"} == set()  # a cache, which renders fill

    def is_right(self, exact: bool = True) -> None:
        """Assert that the project is in a right state, or was never begun: no mixture of generations, nothing lost."""
        if not (self.project / "project.json").exists() or not self.chain():
            return
        state = self.states[self.chain()]
        assert not exact or not self.differs(state)
        pictures, shown = self.pictures()
        assert shown.code == 0, shown.text
        assert not exact or pictures == state.pictures


def digest(path: Path) -> str:
    """Digest of a file's content; equal tensors are equal in whatever order their header names them."""
    data = path.read_bytes()
    try:
        if path.suffix == ".safetensors":
            end = 8 + int.from_bytes(data[:8], "little")
            data = json.dumps(json.loads(data[8:end]), sort_keys=True).encode() + data[end:]
        elif path.suffix == ".npz":  # its members carry the time of writing
            with np.load(path, allow_pickle=False) as arrays:
                data = b"".join(name.encode() + arrays[name].tobytes() for name in sorted(arrays.files))
    except Exception:  # damaged on purpose: the bytes as they are
        data = b"damaged" + data
    return hashlib.sha256(data).hexdigest()[:16]
