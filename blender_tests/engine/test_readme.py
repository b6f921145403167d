"""The library snippet of README.md runs as printed on the demo capture with only the wheel installed."""

import subprocess
import sys
import sysconfig
import venv
from pathlib import Path

from blender_tests.engine.conftest import ROOT
from karf_engine.project import Project

CHECKS = """
assert "site-packages" in karf.__file__
assert picture[frame.masks[model.objects.index("pot")]].mean(0).argmax() == 2, "the pot is not blue"
"""


def test_readme_snippet_runs_as_printed(wheel, tmp_path):
    section = (ROOT / "README.md").read_text(encoding="utf-8").partition("## The library\n")[2]
    snippet = section.partition("```python\n")[2].partition("```")[0]
    home, work = tmp_path / "home", tmp_path / "work"
    venv.create(home, with_pip=False, symlinks=True)
    place = Path(sysconfig.get_path("purelib", vars={"base": str(home), "platbase": str(home)}))
    install = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--target", str(place), str(wheel)]
    subprocess.run(install, check=True)
    # torch and other packages come from this environment, where karf_engine is not installed
    (place / "packages.pth").write_text(sysconfig.get_path("purelib"))
    work.mkdir()
    (work / "demo").symlink_to(ROOT / "demo")
    command = [home / "bin" / "python", "-c", snippet + CHECKS]
    done = subprocess.run(command, cwd=work, capture_output=True, text=True, timeout=1200)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[-1].startswith("(512, 512, 3)")
    assert (work / "blue_pot.json").exists() and Project(work / "demo_karf").finished("recoloring")
