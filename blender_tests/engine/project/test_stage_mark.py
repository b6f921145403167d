"""The mark of a stage stands for its result and for those that it was built on."""

import pytest

from karf_engine.project import Project
from karf_engine.project.state import result_fingerprint

BEFORE = ("geometry", "segmentation", "palette", "recoloring")


@pytest.fixture
def project(tmp_path):
    project = Project(tmp_path / "project")
    project.create("/captures/pots")
    finish(project, *BEFORE, "splats")
    return project


def finish(project, *stages, **summary):
    for stage in stages:
        project.finish(stage, f"inputs of {stage}", files={f"{stage}.safetensors": "sum"}, **summary)


@pytest.mark.parametrize("stage", BEFORE)
@pytest.mark.parametrize("fingerprint, checksum", [("others", "sum"), ("inputs of {stage}", "other sum")])
def test_it_changes_with_every_stage_before(project, stage, fingerprint, checksum):
    before = result_fingerprint(project.state(), "recoloring")
    project.finish(stage, fingerprint.format(stage=stage), files={f"{stage}.safetensors": checksum})
    finish(project, *BEFORE[BEFORE.index(stage) + 1 :])
    assert result_fingerprint(project.state(), "recoloring") != before


def test_it_stays_with_the_same_results_and_with_those_of_other_stages(project):
    before = result_fingerprint(project.state(), "segmentation")
    finish(project, *BEFORE, seconds=3.5)
    project.finish("recoloring", "others")
    project.finish("splats", "others")
    assert result_fingerprint(project.state(), "segmentation") == before


def test_nothing_learned_has_a_mark_too(project):
    assert result_fingerprint({}, "recoloring") not in ("", result_fingerprint(project.state(), "recoloring"))
