"""What other packages bring: an installed karf learns with it, opens what was learned, and says where it is missing."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from blender_tests.engine.conftest import ROOT

EXAMPLES = ("fields/example_field.py", "heads/example_head.py", "capture/example_format.py")
CHOSEN = ("geometry.field=balls", "segmentation.head=fourier", "segmentation.labels=exact", "recoloring.layer=linear")
LOAD = "import karf_engine as karf; model = karf.load('project', device='cpu'); "
OPEN = LOAD + "print(model.scene.field.kind, *model.objects)"


@pytest.fixture(scope="module")
def plugin(tmp_path_factory) -> Path:
    """The example package's wheel, of the examples of docs/extending.md."""
    sources = tmp_path_factory.mktemp("plugin") / "sources"
    shutil.copytree(Path(__file__).parent / "plugin", sources, ignore=shutil.ignore_patterns("__pycache__"))
    for example in EXAMPLES:
        shutil.copy(ROOT / "blender_tests" / "engine" / example, sources)
    build = "from setuptools import build_meta; print(build_meta.build_wheel('..'))"
    done = subprocess.run([sys.executable, "-c", build], cwd=sources, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return sources.parent / done.stdout.splitlines()[-1]


@pytest.fixture(scope="module")
def installed(wheel, plugin, tmp_path_factory) -> dict[str, Path]:
    """Folders of fresh installations: of karf alone, and with the example package."""
    folders = {"alone": [wheel], "with it": [wheel, plugin]}
    places = {name: tmp_path_factory.mktemp("installed") for name in folders}
    install = "-m pip install --quiet --no-deps --no-index --target".split()
    for name, wheels in folders.items():
        subprocess.run([sys.executable, *install, places[name], *wheels], check=True)
    return places


def run(place: Path, work: Path, *arguments) -> subprocess.CompletedProcess:
    """Run Python with the packages of a place, in a folder without another karf_engine; torch is this environment's."""
    environment = os.environ | {"PYTHONPATH": str(place), "OMP_NUM_THREADS": "1"}
    command = [sys.executable, *map(str, arguments)]
    return subprocess.run(command, cwd=work, env=environment, capture_output=True, text=True, timeout=900)


@pytest.fixture(scope="module")
def work(installed, still_life, tmp_path_factory) -> Path:
    """A folder with a project that was learned by what the package brings."""
    work = tmp_path_factory.mktemp("work")
    done = run(installed["with it"], work, "-m", "karf_engine", *still_life.command(work / "project", *CHOSEN))
    assert done.returncode == 0, done.stderr
    return work


def test_a_field_of_another_package_is_opened_with_it_and_refused_in_a_sentence_without(installed, work):
    done = run(installed["with it"], work, "-c", OPEN)
    assert done.stdout.split() == ["balls", "ball", "block"], done.stderr
    done = run(installed["alone"], work, "-c", OPEN)
    last = done.stderr.splitlines()[-1]
    assert done.returncode == 1 and "balls" in last and ("BadRequest" in last or "DataError" in last)


def test_a_capture_format_of_a_package_is_read(installed, tmp_path):
    (tmp_path / "cameras.csv").write_text(
        f"photo,width,height,focal,camera_to_world\na.png,8,6,9,{'1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1'}\n"
    )
    code = "import karf_engine as karf; print(karf.open_capture('.', photos=False))"
    assert "csv: 1 train" in run(installed["with it"], tmp_path, "-c", code).stdout
    assert "not a capture of a known format" in run(installed["alone"], tmp_path, "-c", code).stderr


def test_a_package_that_cannot_be_loaded_is_named(installed, tmp_path):
    place = shutil.copytree(installed["with it"], tmp_path / "broken")
    (place / "example_field.py").write_text("raise ImportError('no such thing')\n")
    code = "from karf_engine.fields.registry import field_kind; field_kind('balls')"
    told = run(place, tmp_path, "-c", code).stderr.splitlines()[-1]
    assert "MissingDependency" in told and "karf-example" in told and "no such thing" in told
