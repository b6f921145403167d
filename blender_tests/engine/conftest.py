"""Fixtures of the engine's tests."""

import json
import os
import platform
import shutil
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
LONG_PATH = 180  # characters of a folder; files of a project below it need more
QUICK = tuple(
    """
    geometry.long_side=32 geometry.samples=16000 geometry.max_rays=2048 geometry.features=6
    geometry.levels=[{"voxels":24,"iterations":70,"step":1.0},{"voxels":36,"iterations":70,"step":0.75}]
    geometry.table_rate=0.1 geometry.network_rate=0.003
    segmentation.iterations=120 segmentation.rate=0.01 segmentation.batch=256 segmentation.width=16
    segmentation.cache_long_side=32
    recoloring.iterations=40 recoloring.batch=256 recoloring.width=16
    splats.iterations=40 splats.count=2000 splats.long_side=48
    """.split()
)


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--device", default="cpu", help="where tensors live: cpu, cuda, cuda:NUMBER or pretend")
    parser.addoption("--device-report", type=Path, metavar="FILE", help="write each test's outcome as JSON")


@pytest.fixture
def device(request) -> Iterator:
    """The torch.device of `--device`; every test that makes tensors makes them there."""
    torch = pytest.importorskip("torch")
    name = request.config.getoption("device")
    if name == "pretend":
        from blender_tests.engine.pretend_device import pretend_device

        with pretend_device() as pretended:
            yield pretended
    else:
        yield torch.device(name)


OUTCOMES = {}  # test name -> outcome, seconds and error, for the device report


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    if report.when == "call" or report.outcome != "passed":
        raised = report.longreprtext.splitlines()[-1:] if report.failed else []
        OUTCOMES[report.nodeid] = {"outcome": report.outcome, "seconds": round(report.duration, 3), "raised": raised}


def pytest_sessionfinish(session: pytest.Session) -> None:
    path = session.config.getoption("device_report")
    if path is None:
        return
    import torch

    name = session.config.getoption("device")
    report = {
        "device": name,
        "hardware": torch.cuda.get_device_name(name) if name.startswith("cuda") else platform.processor(),
        "system": platform.platform(),
        "torch": torch.__version__,
        "cuda": torch.version.cuda,
        "tests": OUTCOMES,
    }
    path.write_text(json.dumps(report, indent=1))


@pytest.fixture(scope="session")
def scenes() -> Path:
    """Folder of real captures: KARF_SCENES, else shared/scenes beside the checkout; tests are skipped without it."""
    folder = Path(os.environ.get("KARF_SCENES", ROOT.parent / "shared" / "scenes"))
    if not folder.is_dir():
        pytest.skip("no folder of real captures (set KARF_SCENES)")
    return folder


def run_engine(*arguments, python=(), environment=None, **options) -> subprocess.CompletedProcess:
    """Run the command line in a child process with one thread."""
    return subprocess.run(
        [sys.executable, *python, "-m", "karf_engine", *map(str, arguments)],
        cwd=ROOT,
        env=os.environ | {"OMP_NUM_THREADS": "1"} | (environment or {}),
        capture_output=True,
        text=True,
        timeout=900,  # a machine may have much else to do
        **options,
    )


@pytest.fixture(scope="session")
def wheel(tmp_path_factory) -> Path:
    """The engine's wheel, built from a copy of the sources without network."""
    sources = tmp_path_factory.mktemp("wheel") / "sources"
    ignored = shutil.ignore_patterns("__pycache__", "node_modules", "dist")
    shutil.copytree(ROOT / "karf_engine", sources / "karf_engine", ignore=ignored)
    viewer = sources / "karf_engine" / "export" / "page" / "web" / "dist"
    viewer.mkdir(parents=True)
    (viewer / "page.js").touch()  # a stand-in: Node builds the other
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, sources)
    return build_wheel(sources)


def build_wheel(sources: Path) -> Path:
    """Build a wheel beside its sources with this environment's own setuptools."""
    build = "from setuptools import build_meta; print(build_meta.build_wheel('..'))"
    done = subprocess.run([sys.executable, "-c", build], cwd=sources, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return sources.parent / done.stdout.splitlines()[-1]


def odd_folder(parent: Path) -> Path:
    """A folder as users have them: with spaces, letters of other alphabets, and a long path (Windows: 259)."""
    folder = parent / "Jürgen's Töpfe (壺) & 100 %"
    folder /= "x" * max(1, LONG_PATH - len(str(folder)) - 1)
    folder.mkdir(parents=True)
    return folder


@dataclass(frozen=True)
class StillLife:
    """A tiny capture on disk with rough masks of its ball and block."""

    capture: Path
    masks: Path
    photos: dict  # the true pictures by split/stem

    def command(self, project: Path, *more: str) -> list[str]:
        """Arguments that learn all stages quickly."""
        settings = [part for text in (*QUICK, *more) for part in ("--set", text)]
        places = [str(self.capture), "--masks", str(self.masks), "--project", str(project)]
        return ["all", *places, "--threads", "1", *settings]


@pytest.fixture(scope="session")
def still_life(tmp_path_factory) -> StillLife:
    """The still life, photographed from 16 views and two held-out ones."""
    from blender_tests.engine.reference.still_life import write_capture, write_masks

    folder = odd_folder(tmp_path_factory.mktemp("still life"))
    photos = write_capture(folder / "capture")
    write_masks(folder / "masks", photos)
    return StillLife(folder / "capture", folder / "masks", photos)


@dataclass(frozen=True)
class Learned:
    """A project of the still life with every stage done, and what the run printed. Copy it before you change it."""

    project: Path
    output: str


@pytest.fixture(scope="session")
def learned(still_life, tmp_path_factory) -> Learned:
    """The still life, learned once by the command line."""
    project = odd_folder(tmp_path_factory.mktemp("learned")) / "project"
    done = run_engine(*still_life.command(project))
    assert done.returncode == 0, done.stderr
    return Learned(project, done.stderr)


def of_field(model):
    """The same project with `render.source=field`: voxels, not splats, render any camera."""
    from karf_engine.project.contents import settings_for
    from karf_engine.recolor.model import Model  # needs torch

    settings = settings_for(model.project, "render")
    return Model(model.project, "cpu", replace(settings, render=replace(settings.render, source="field")))


def finish_again(folder, *stages):
    """Finish stages again with their present outputs, which makes later stages unfinished."""
    from karf_engine.project import Project

    project = Project(folder)
    for stage, known in {stage: project.finished(stage) for stage in stages}.items():
        project.finish(stage, "again", folder=known["folder"], files=known["files"])
