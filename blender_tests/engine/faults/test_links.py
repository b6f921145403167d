"""No command changes a byte outside of a foreign project in which links replace files or folders."""

import json
import shutil
from pathlib import Path

import pytest

from blender_tests.engine.faults.engine import run_all

# what a finished project lacks, and commands make or look for
ABSENT = (
    *("lock", "lock.json", "lock.lease", "earlier_masks", "corrections", "volumes.json"),
    *("preview.png", "jobs", "photos", "out", "out/recolor", "points.npz", "unfinished_geometry.safetensors"),
)
N_READING = 8  # of the commands below: they do not learn
ONLY_READ = ("out", "jobs", "photos", "points.npz", "planes", "looks")  # no stage makes or looks for these
TARGETS = {  # of a link, from its name and a folder outside
    "a folder": lambda name, outside: outside,
    "a file": lambda name, outside: outside / "geometry.safetensors",
    "nothing": lambda name, outside: outside / "made_by_a_link",
    "a device": lambda name, outside: "/dev/zero",
    "itself": lambda name, outside: name,
}


@pytest.fixture(scope="module")
def commands(bench):
    """Every command on a project, those that change it last."""
    project, view = str(bench.project), ("--views", "test_r_0", "--threads", "1")
    sheet = bench.folder / "sheet.json"
    sheet.write_text(json.dumps([{"colorway": "blue", "object": "ball", "hex": "#3059b8"}]))
    return [
        ["palette", project, "--json"],
        ["palette", project, "--out", f"{project}/out/edit.json"],
        [*bench.match[:-1], f"{project}/out/match.json"],
        ["farm", project, "--out", str(bench.folder / "made" / "farm"), *view],
        ["points", project, "--out", f"{project}/points.npz", "--count", "1000", "--threads", "1"],
        ["export-splat", project, "--out", f"{project}/out/a.ply", "--threads", "1"],
        ["colorways", project, "--sheet", str(sheet), "--out", f"{project}/out", *view],
        ["render", project, "--out", f"{project}/out", "--planes", "--layers", "--depth", *view],
        *(bench.command(stage, True, stage) for stage in ("splats", "recoloring", "palette", "segmentation")),
        bench.command("geometry", True),
    ]


@pytest.fixture(scope="module")
def complete(bench, commands):
    """A project in which every command has run once."""
    bench.restore(bench.complete.folder)
    codes, text = run_all(commands[:N_READING])
    shutil.rmtree(bench.folder / "made", ignore_errors=True)
    assert codes == [0] * N_READING, text
    return shutil.copytree(bench.project, bench.folder / "complete")


def entries(project):
    """All entries at the first level of a project, and below it the first file and folder of each folder."""
    found = sorted(path.relative_to(project) for path in project.rglob("*"))
    first = {(path.parent, project.joinpath(path).is_dir()): path for path in reversed(found) if len(path.parts) > 1}
    return sorted({path for path in found if len(path.parts) == 1} | {*first.values()})


def state_outside(bench):
    """The bytes of all files in the workspace, except in the project and in what commands make."""
    own = (bench.project, bench.folder / "made")
    paths = [path for path in bench.folder.rglob("*") if not any(path.is_relative_to(folder) for folder in own)]
    return {path: path.read_bytes() if path.is_file() and not path.is_symlink() else None for path in paths}


def test_link_in_project_changes_nothing_outside(bench, commands, complete, few, subtests):
    outside = shutil.copytree(bench.complete.folder, bench.folder / "outside")
    for number, place in enumerate([*entries(complete), *map(Path, ABSENT)]):
        for kind in [list(TARGETS)[number % len(TARGETS)]] if few else TARGETS:
            with subtests.test(place=str(place), kind=kind):
                bench.restore(complete)
                path = bench.project / place
                path.parent.mkdir(parents=True, exist_ok=True)
                shutil.rmtree(path) if path.is_dir() else path.unlink(missing_ok=True)
                path.symlink_to(TARGETS[kind](path.name, outside))
                before = state_outside(bench)
                codes, text = run_all(commands[:N_READING] if few and place.parts[0] in ONLY_READ else commands)
                assert "Traceback" not in text and "Internal error" not in text, text
                assert None not in codes and all(code in (0, 2, 4) for code in codes), (codes, text)
                after = state_outside(bench)
                assert sorted(path for path in before.keys() | after if before.get(path, 0) != after.get(path, 0)) == []
                shutil.rmtree(bench.folder / "made", ignore_errors=True)


def test_linked_project_folder_works(bench, commands, complete):
    bench.restore(None)
    real = shutil.copytree(complete, bench.folder / "real")
    bench.project.symlink_to(real)
    codes, text = run_all(commands[3:N_READING])
    bench.restore(None)
    for folder in (real, bench.folder / "made"):
        shutil.rmtree(folder, ignore_errors=True)
    assert codes == [0] * 5, text
