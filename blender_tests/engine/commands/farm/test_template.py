"""No name in a job template is read as a reference to one of the job's parameters."""

import re

import pytest

from karf_engine.commands.farm.template import Frames, learning_job, render_job
from karf_engine.errors import BadRequest

FRAMES = Frames("all", "", 4, 2)
BRACES = ["{{Param.EnginePython}}", "{{{Param.EnginePython}}}", "{{", "}}", "{{{{Session.WorkingDirectory}}}}"]
REFERENCE = re.compile(r"\{\{((?:Task\.)?Param\.\w+)\}\}")


def assert_references_known(job):
    """Assert that all double braces refer to a parameter of the job."""
    known = {f"Param.{each['name']}" for each in job["parameterDefinitions"]} | {"Task.Param.Frame"}
    texts = [job["name"], *(text for step in job["steps"] for text in step["script"]["actions"]["onRun"]["args"])]
    for text in texts:
        assert set(REFERENCE.findall(text)) <= known
        assert not re.search(r"\{\{|\}\}", REFERENCE.sub("", text))


@pytest.mark.parametrize("braces", BRACES)
def test_double_braces_are_escaped_in_names_and_rejected_in_arguments(braces):
    for job in (render_job(f"KaRF {braces}", FRAMES), learning_job(f"KaRF {braces}", "", (), (), FRAMES)):
        assert_references_known(job)
        assert not REFERENCE.search(job["name"])
    for make in (
        lambda: render_job("film", Frames(braces, "", 4, 2)),
        lambda: render_job("film", Frames("all", "", 4, 2, ("--background", braces))),
        lambda: learning_job("film", f"{braces}.json", (), (), FRAMES),
        lambda: learning_job("film", "", ("--set", braces), (), FRAMES),
        lambda: learning_job("film", "", (), ("--device", braces), FRAMES),
    ):
        with pytest.raises(BadRequest, match="two braces"):
            make()


def test_single_braces_are_kept():
    job = learning_job("film {a}", "cameras {b}.json", ("--set", 'geometry.levels=[{"voxels": 8}]'), (), FRAMES)
    assert_references_known(job)
    assert job["name"] == "film {a}"
    assert "{{Param.Capture}}/cameras {b}.json" in job["steps"][0]["script"]["actions"]["onRun"]["args"]
