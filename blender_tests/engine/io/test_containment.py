"""Paths of a folder that a stranger filled: a link that leads out of it is refused by name."""

import os

import pytest

from karf_engine.errors import DataError
from karf_engine.io.containment import check_tree, checked_path

pytestmark = pytest.mark.skipif(os.name == "nt", reason="links need a right on Windows")


@pytest.fixture
def project(tmp_path):
    """A project beside a file and a folder that it must not reach."""
    (tmp_path / "other" / "deep").mkdir(parents=True)
    (tmp_path / "secret.txt").write_text("secret")
    folder = tmp_path / "project"
    (folder / "masks" / "pot").mkdir(parents=True)
    return folder


OUTSIDE = ["..", "../other", "../secret.txt", "/dev/zero", "../not_there", "/", "masks/../../other"]


@pytest.mark.parametrize("target", OUTSIDE)
@pytest.mark.parametrize("names", [("looks",), ("looks", "a", "b.npz"), ("masks", "link", "r_0.png")])
def test_a_link_that_leads_out_is_named_with_its_target(project, target, names):
    link = project / ("masks/link" if "link" in names else names[0])
    link.symlink_to(target if target.startswith("/") else project / target)
    with pytest.raises(DataError) as caught:
        checked_path(project, *names)
    assert str(link) in caught.value.sentence and "is a link to" in caught.value.sentence and caught.value.hint


def test_links_that_lead_to_one_another_are_refused(project):
    (project / "a").symlink_to("b")
    (project / "b").symlink_to("a")
    with pytest.raises(DataError, match="is a link to b"):
        checked_path(project, "a", "x.png")


def test_links_within_the_folder_and_a_link_to_the_folder_are_followed(project, tmp_path):
    (project / "planes").symlink_to("masks")
    (tmp_path / "shortcut").symlink_to(project)
    assert checked_path(tmp_path / "shortcut", "planes", "r_0.npz") == tmp_path / "shortcut" / "planes" / "r_0.npz"


def test_a_tree_is_refused_for_any_link_in_it_that_leads_out_and_not_for_one_to_nothing(project):
    (project / "masks" / ".tmp.sync").symlink_to("nowhere")
    assert check_tree(project, project / "masks") == project / "masks"
    (project / "masks" / "pot" / "r_0.png").symlink_to(project.parent / "secret.txt")
    with pytest.raises(DataError, match=r"masks/pot/r_0\.png is a link"):
        check_tree(project, project / "masks")
