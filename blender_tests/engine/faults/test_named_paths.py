"""Every command names the path that it could not write, and reports memory that ran out."""

import errno
import os
import resource
import shutil
from functools import partial
from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pytest

from blender_tests.engine.commands.farm.sequences import Sequence
from blender_tests.engine.conftest import QUICK
from blender_tests.engine.faults import engine
from blender_tests.engine.faults.traps import refuse_changes
from blender_tests.engine.splats.clouds import cloud
from karf_engine.io.files import write_json
from karf_engine.io.images import write_png
from karf_engine.project import STAGE_ORDER, Project
from karf_engine.project.state import without_stage, write_state
from karf_engine.splats.formats import ply
from karf_engine.splats.formats.splat_file import SplatFile
from karf_engine.worker.protocol import Request

BAD_DATA, OUT_OF_MEMORY = 4, 5
# stages of the project run again, so that they have something to write
COMMANDS = {
    "inspect": "inspect {capture} --out {out}/inspected",
    "mark": "mark {capture} --view train_r_0 --object pot --out {out}/masks --box 4,4,20,20",
    "all": "all {capture} --masks {masks} --project {out}/project",
    "geometry": "geometry {capture} --project {out}/project",
    "segmentation": "segmentation {project} --masks {masks}",
    "palette": "palette {project}",
    "edit": "palette {project} --out {out}/edit.json",
    "recoloring": "recoloring {project}",
    "splats": "splats {project}",
    "erase": "erase {project} --box 9,0,0,9,0,9,0,0,0,0,9,0,0,0,0,1",
    "match": "match {project} --object ball --from #b5302c --to #3059b8 --out {out}/edit.json",
    "render": "render {project} --views test --planes --depth --layers --out {out}/frames --edit {inputs}/edit.json",
    "frames as EXR": "render {project} --views {inputs}/cameras.json --format exr16 --out {out}/frames --edit {inputs}/edit.json",
    "colorways": "colorways {project} --sheet {inputs}/sheet.csv --views test --out {out}/colorways",
    "points": "points {project} --out {out}/points.ply --count 1000",
    **{f"export-splat {end}": f"export-splat {{project}} --out {{out}}/cloud{end}" for end in (".gltf", ".usdc")},
    "import-splat": "import-splat {inputs}/cloud.ply --out {out}/capture --views 3 --size 64",
    "poses": "poses {capture}/train --out {out}/capture",
    "pinhole": "pinhole {inputs}/360 --out {out}/capture",
    "farm": "farm {project} --views test --out {out}/bundle --edit {inputs}/edit.json",
    "farm that learns": "farm {capture} --masks {masks} --out {out}/bundle",
    "run": "run {out}/job",
}  # fmt: skip


def no_bytes(_: Path) -> None:
    """Forbid this process to write a byte to any file; the system names no path then."""
    resource.setrlimit(resource.RLIMIT_FSIZE, (0, resource.RLIM_INFINITY))


def no_bytes_and_no_links(disk: Path) -> None:
    """The same with the input files on another disk."""
    no_bytes(disk)
    os.link = Mock(side_effect=OSError(errno.EXDEV, os.strerror(errno.EXDEV)))


SOME = ("edit", "frames as EXR", "export-splat .usdc", "farm")
FAULTS = {  # and the commands that they strike
    "disk full": (partial(refuse_changes, number=errno.ENOSPC), COMMANDS),
    "quota": (partial(refuse_changes, number=errno.EDQUOT), SOME),
    "read-only disk": (partial(refuse_changes, number=errno.EROFS), SOME),
    "no permission": (partial(refuse_changes, number=errno.EACCES), SOME),
    "no byte can be written": (no_bytes, COMMANDS),
    "no byte, on another disk": (no_bytes_and_no_links, ("poses", "import-splat")),
    "no memory": (partial(refuse_changes, number=None), COMMANDS),
}


@pytest.fixture(scope="module")
def places(still_life, learned, tmp_path_factory):
    """Inputs of the commands, and the disk on which they write."""
    folder = tmp_path_factory.mktemp("named paths")
    inputs = folder / "inputs"
    inputs.mkdir()
    Sequence(learned.project, inputs, 2)
    ply.write(inputs / "cloud.ply", SplatFile(cloud()))
    panorama = {"file_path": "360.png", "camera_model": "EQUIRECTANGULAR", "transform_matrix": np.eye(4).tolist()}
    write_json(inputs / "360" / "transforms.json", {"frames": [panorama]})
    write_png(inputs / "360" / "360.png", np.zeros((64, 128, 3)))
    (inputs / "sheet.csv").write_text("colorway,object,hex\nGreen,ball,#1ec040\n")
    disk = folder / "disk"
    given = {"capture": still_life.capture, "masks": still_life.masks, "inputs": inputs}
    with pytest.MonkeyPatch.context() as patch:
        engine.prepare(patch)
        yield given | {"disk": disk, "project": disk / "project", "out": disk / "out"}


@pytest.mark.parametrize(("fault", "name"), [(fault, name) for fault, (_, names) in FAULTS.items() for name in names])
def test_failed_write_names_the_path(places, learned, fault, name):
    disk, project, job = places["disk"], Project(places["project"]), places["out"] / "job"
    shutil.rmtree(disk, ignore_errors=True)
    job.mkdir(parents=True)
    shutil.copytree(learned.project, project.folder)
    if name in STAGE_ORDER[1:]:
        write_state(project.state_file, without_stage(project.state(), name))
    edit = {"object": "ball", "source": "#b5302c", "target": "#3059b8", "out": f"{places['out']}/edit.json"}
    Request("match", project.folder, edit).write(job)
    settings = [part for text in QUICK for part in ("--set", text)] if name in ("all", "geometry") else []
    command = [word.format(**places) for word in COMMANDS[name].split()]
    ended = engine.run(command + settings, partial(FAULTS[fault][0], disk))
    assert ended.code == (OUT_OF_MEMORY if fault == "no memory" else BAD_DATA), ended.text
    assert fault == "no memory" or str(disk) in ended.sentence
