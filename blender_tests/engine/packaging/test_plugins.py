"""An installed karf uses the fields, heads, layers, formats and labels of another installed package."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from blender_tests.engine.conftest import ROOT, build_wheel

EXAMPLES = ("fields/example_field.py", "heads/example_head.py", "capture/example_format.py")
CHOSEN = ("geometry.field=balls", "segmentation.head=fourier", "segmentation.labels=exact", "recoloring.layer=linear")
OPEN = """
import karf_engine as karf
model = karf.load('project', device='cpu')
print(model.scene.field.kind, *model.objects)
"""


@pytest.fixture(scope="module")
def plugin(tmp_path_factory) -> Path:
    """The wheel of the example package of docs/extending.md."""
    sources = tmp_path_factory.mktemp("plugin") / "sources"
    shutil.copytree(Path(__file__).parent / "plugin", sources, ignore=shutil.ignore_patterns("__pycache__"))
    for example in EXAMPLES:
        shutil.copy(ROOT / "blender_tests" / "engine" / example, sources)
    return build_wheel(sources)


@pytest.fixture(scope="module")
def installed(wheel, plugin, tmp_path_factory) -> dict[str, Path]:
    """Folders of fresh installations: karf alone, and with the plugin."""
    wheels = {"alone": [wheel], "plugin": [wheel, plugin]}
    places = {name: tmp_path_factory.mktemp("installed") for name in wheels}
    install = "-m pip install --quiet --no-deps --no-index --target".split()
    for name, place in places.items():
        subprocess.run([sys.executable, *install, place, *wheels[name]], check=True)
    return places


def run(place: Path, work: Path, *arguments) -> subprocess.CompletedProcess:
    """Run Python with an installation's packages and this environment's torch."""
    environment = os.environ | {"PYTHONPATH": str(place), "OMP_NUM_THREADS": "1"}
    command = [sys.executable, *map(str, arguments)]
    return subprocess.run(command, cwd=work, env=environment, capture_output=True, text=True, timeout=900)


@pytest.fixture(scope="module")
def work(installed, still_life, tmp_path_factory) -> Path:
    """A folder with a project that was learned with the plugin."""
    work = tmp_path_factory.mktemp("work")
    done = run(installed["plugin"], work, "-m", "karf_engine", *still_life.command(work / "project", *CHOSEN))
    assert done.returncode == 0, done.stderr
    return work


def test_project_with_plugin_field_needs_the_plugin(installed, work):
    done = run(installed["plugin"], work, "-c", OPEN)
    assert done.stdout.split() == ["balls", "ball", "block"], done.stderr
    done = run(installed["alone"], work, "-c", OPEN)
    last = done.stderr.splitlines()[-1]
    assert done.returncode == 1 and "balls" in last and ("BadRequest" in last or "DataError" in last)


def test_plugin_format_needs_the_plugin(installed, tmp_path):
    rows = "photo,width,height,focal,camera_to_world\na.png,8,6,9,1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1\n"
    (tmp_path / "cameras.csv").write_text(rows)
    code = "import karf_engine as karf; print(karf.open_capture('.', photos=False))"
    assert "csv: 1 train" in run(installed["plugin"], tmp_path, "-c", code).stdout
    assert "not a capture of a known format" in run(installed["alone"], tmp_path, "-c", code).stderr


def test_broken_plugin_is_named(installed, tmp_path):
    place = shutil.copytree(installed["plugin"], tmp_path / "broken")
    (place / "example_field.py").write_text("raise ImportError('no such thing')\n")
    code = "from karf_engine.fields.registry import field_kind; field_kind('balls')"
    last = run(place, tmp_path, "-c", code).stderr.splitlines()[-1]
    assert "MissingDependency" in last and "karf-example" in last and "no such thing" in last
