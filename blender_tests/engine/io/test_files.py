"""Files that are written keep links and rights, a failure names the file, and no link leads out of a stranger's folder."""

import errno
import os
from pathlib import Path

import pytest

from karf_engine.errors import DataError
from karf_engine.io import files
from karf_engine.io.containment import check_tree, checked_path
from karf_engine.io.files import atomic_write, copy_file, write_json

POSIX = pytest.mark.skipif(os.name == "nt", reason="rights, and folders that are flushed, are of POSIX")
LINKS = pytest.mark.skipif(os.name == "nt", reason="links need a right on Windows")
DISK_FULL = RuntimeError("Error while serializing: I/O error: No space left on device (os error 28)")


@pytest.mark.parametrize(
    ("raised", "probed", "number"),
    [
        (OSError(errno.ENOSPC, "No space left on device"), None, errno.ENOSPC),
        (OSError(errno.EDQUOT, "Disk quota exceeded", "/film/source.png"), None, errno.EDQUOT),
        (DISK_FULL, None, errno.ENOSPC),
        (RuntimeError("unable to write"), errno.ENOSPC, errno.ENOSPC),  # a library that gives no reason
    ],
)
def test_what_could_not_be_written_is_named_and_not_what_it_came_from(tmp_path, monkeypatch, raised, probed, number):
    def write(temporary):
        temporary.write_text("half")
        raise raised

    monkeypatch.setattr(files, "_probe", lambda folder: probed)
    with pytest.raises(OSError) as caught:
        atomic_write(tmp_path / "a.exr", write)
    assert (caught.value.filename, caught.value.errno) == (str(tmp_path / "a.exr"), number)
    assert list(tmp_path.iterdir()) == []


def test_errors_of_another_kind_and_of_the_source_stay_what_they_are(tmp_path):
    with pytest.raises(ZeroDivisionError):
        atomic_write(tmp_path / "a.exr", lambda temporary: 1 / 0)
    with pytest.raises(FileNotFoundError) as caught:
        copy_file(tmp_path / "gone.png", tmp_path / "a.png")
    assert caught.value.filename == str(tmp_path / "gone.png")


@pytest.fixture
def path(tmp_path):
    write_json(tmp_path / "edit.json", {"old": True})
    return tmp_path / "edit.json"


@LINKS
def test_a_linked_file_stays_a_link_and_what_it_leads_to_is_written(path):
    link = path.with_name("blue.json")
    link.symlink_to("edit.json")
    write_json(link, {"new": True})
    assert link.is_symlink() and "new" in path.read_text()


def test_a_read_only_file_is_refused_and_stays_as_it_is(path):
    path.chmod(0o444)
    with pytest.raises(PermissionError) as caught:
        write_json(path, {"new": True})
    assert caught.value.filename == str(path) and "old" in path.read_text()
    path.chmod(0o644)


@POSIX
def test_a_file_keeps_its_rights_and_its_rename_is_flushed_with_the_folder(path, monkeypatch):
    flushed = []
    monkeypatch.setattr(os, "fsync", lambda handle: flushed.append(Path(f"/proc/self/fd/{handle}").readlink()))
    path.chmod(0o640)
    write_json(path, {"new": True})
    assert path.stat().st_mode & 0o777 == 0o640 and flushed[-1] == path.parent


@pytest.fixture
def project(tmp_path):
    """A project beside a file and a folder that it must not reach."""
    (tmp_path / "other" / "deep").mkdir(parents=True)
    (tmp_path / "secret.txt").write_text("secret")
    folder = tmp_path / "project"
    (folder / "masks" / "pot").mkdir(parents=True)
    return folder


@LINKS
@pytest.mark.parametrize(
    "target", ["..", "../other", "../secret.txt", "/dev/zero", "../not_there", "/", "masks/../../other"]
)
@pytest.mark.parametrize("names", [("looks",), ("looks", "a", "b.npz"), ("masks", "link", "r_0.png")])
def test_a_link_that_leads_out_is_named_with_its_target(project, target, names):
    link = project / ("masks/link" if "link" in names else names[0])
    link.symlink_to(target if target.startswith("/") else project / target)
    with pytest.raises(DataError) as caught:
        checked_path(project, *names)
    assert str(link) in caught.value.sentence and "is a link to" in caught.value.sentence and caught.value.hint


@LINKS
def test_links_within_the_folder_are_followed_but_not_in_a_circle(project, tmp_path):
    (project / "planes").symlink_to("masks")
    (tmp_path / "shortcut").symlink_to(project)
    assert checked_path(tmp_path / "shortcut", "planes", "r_0.npz") == tmp_path / "shortcut" / "planes" / "r_0.npz"
    (project / "a").symlink_to("b")
    (project / "b").symlink_to("a")
    with pytest.raises(DataError, match="is a link to b"):
        checked_path(project, "a", "x.png")


@LINKS
def test_a_tree_is_refused_for_any_link_in_it_that_leads_out_and_not_for_one_to_nothing(project):
    (project / "masks" / ".tmp.sync").symlink_to("nowhere")
    assert check_tree(project, project / "masks") == project / "masks"
    (project / "masks" / "pot" / "r_0.png").symlink_to(project.parent / "secret.txt")
    with pytest.raises(DataError, match=r"masks/pot/r_0\.png is a link"):
        check_tree(project, project / "masks")
