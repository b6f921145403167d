"""A project from elsewhere with a link in place of a file or folder: no command changes a byte outside of it."""

import json
import shutil
from pathlib import Path

import pytest

from blender_tests.engine.faults.engine import run_all

# what a finished project does not have, and commands make or look for
MADE = (
    *("lock", "lock.json", "lock.lease", "earlier_masks", "corrections", "volumes.json"),
    *("preview.png", "jobs", "photos", "out", "out/recolor", "points.npz", "unfinished_geometry.safetensors"),
)
READING = 8  # of the commands below: what they write does not change what is learned
OF_READING = ("out", "jobs", "photos", "points.npz", "planes", "looks")  # what no stage that learns makes or looks for


KINDS = {  # what a link leads to, from its name and a folder outside
    "a folder": lambda name, outside: outside,
    "a file": lambda name, outside: outside / "geometry.safetensors",
    "nothing": lambda name, outside: outside / "made_by_a_link",
    "a device": lambda name, outside: "/dev/zero",
    "itself": lambda name, outside: name,
}


@pytest.fixture(scope="module")
def commands(bench):
    """Every command that is given a project, those that change it last."""
    out, made = str(bench.project / "out"), bench.folder / "made"
    project, view = str(bench.project), ("--views", "test_r_0", "--threads", "1")
    sheet = bench.folder / "sheet.json"
    sheet.write_text(json.dumps([{"colorway": "blue", "object": "ball", "hex": "#3059b8"}]))
    return [
        ["palette", project, "--json"],
        ["palette", project, "--out", str(bench.project / "out" / "edit.json")],
        [*bench.match[:-1], str(bench.project / "out" / "match.json")],
        ["farm", project, "--out", str(made / "farm"), *view],
        ["points", project, "--out", str(bench.project / "points.npz"), "--count", "1000", "--threads", "1"],
        ["export-splat", project, "--out", str(bench.project / "out" / "a.ply"), "--threads", "1"],
        ["colorways", project, "--sheet", str(sheet), "--out", out, *view],
        ["render", project, "--out", out, "--planes", "--layers", "--depth", *view],
        *(bench.command(stage, True, stage) for stage in ("splats", "recoloring", "palette", "segmentation")),
        bench.command("geometry", True),
    ]


@pytest.fixture(scope="module")
def complete(bench, commands):
    """A project in which every command has run once."""
    bench.restore(bench.complete.folder)
    codes, text = run_all(commands[:READING])
    shutil.rmtree(bench.folder / "made", ignore_errors=True)
    assert codes == [0] * READING, text
    return shutil.copytree(bench.project, bench.folder / "complete")


def entries(project):
    """Files and folders of a project, of each folder below its first level only the first."""
    found = sorted(path.relative_to(project) for path in project.rglob("*"))
    first = {(path.parent, project.joinpath(path).is_dir()): path for path in reversed(found) if len(path.parts) > 1}
    return sorted({path for path in found if len(path.parts) == 1} | {*first.values()})


def state_of(folder, but):
    """What lies in a folder, to the byte; `but`: folders in it that do not count."""
    paths = [path for path in folder.rglob("*") if not any(path.is_relative_to(own) for own in but)]
    return {path: path.read_bytes() if path.is_file() and not path.is_symlink() else None for path in paths}


def test_a_link_in_place_of_any_file_or_folder_changes_nothing_outside(bench, commands, complete, few, subtests):
    outside = shutil.copytree(bench.complete.folder, bench.folder / "outside")
    own = (bench.project, bench.folder / "made")
    for number, place in enumerate([*entries(complete), *map(Path, MADE)]):
        for kind in [list(KINDS)[number % len(KINDS)]] if few else KINDS:
            with subtests.test(place=str(place), kind=kind):
                bench.restore(complete)
                path = bench.project / place
                path.parent.mkdir(parents=True, exist_ok=True)
                shutil.rmtree(path) if path.is_dir() else path.unlink(missing_ok=True)
                path.symlink_to(KINDS[kind](path.name, outside))
                before = state_of(bench.folder, own)
                some = few and place.parts[0] in OF_READING
                codes, text = run_all(commands[:READING] if some else commands)
                assert "Traceback" not in text and "Internal error" not in text, text
                assert None not in codes and all(code in (0, 2, 4) for code in codes), (codes, text)
                after = state_of(bench.folder, own)
                assert sorted(path for path in before.keys() | after if before.get(path, 0) != after.get(path, 0)) == []
                shutil.rmtree(bench.folder / "made", ignore_errors=True)


def test_a_project_that_is_reached_through_a_link_works(bench, commands, complete):
    bench.restore(None)
    real = shutil.copytree(complete, bench.folder / "real")
    bench.project.symlink_to(real)
    codes, text = run_all(commands[3:READING])
    bench.restore(None)
    for folder in (real, bench.folder / "made"):
        shutil.rmtree(folder, ignore_errors=True)
    assert codes == [0] * 5, text
