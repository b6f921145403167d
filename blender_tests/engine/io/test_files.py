"""Written files keep links and modes, write errors name the file, and links must not leave a project."""

import errno
import os
from pathlib import Path

import pytest

from karf_engine.errors import DataError
from karf_engine.io import files
from karf_engine.io.containment import check_tree, checked_path
from karf_engine.io.files import atomic_write, copy_file, write_json

POSIX = pytest.mark.skipif(os.name == "nt", reason="file modes and flushing folders are POSIX features")
LINKS = pytest.mark.skipif(os.name == "nt", reason="links need a privilege on Windows")
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
def test_write_errors_name_the_target_file(tmp_path, monkeypatch, raised, probed, number):
    def write(temporary):
        temporary.write_text("half")
        raise raised

    monkeypatch.setattr(files, "_probe", lambda folder: probed)
    with pytest.raises(OSError) as caught:
        atomic_write(tmp_path / "a.exr", write)
    assert (caught.value.filename, caught.value.errno) == (str(tmp_path / "a.exr"), number)
    assert list(tmp_path.iterdir()) == []


def test_other_errors_and_source_errors_stay_unchanged(tmp_path):
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
def test_writing_through_a_link_changes_its_target(path):
    link = path.with_name("blue.json")
    link.symlink_to("edit.json")
    write_json(link, {"new": True})
    assert link.is_symlink() and "new" in path.read_text()


def test_read_only_file_is_not_overwritten(path):
    path.chmod(0o444)
    with pytest.raises(PermissionError) as caught:
        write_json(path, {"new": True})
    assert caught.value.filename == str(path) and "old" in path.read_text()
    path.chmod(0o644)


@POSIX
def test_overwriting_keeps_the_mode_and_flushes_the_folder(path, monkeypatch):
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
def test_link_that_leaves_the_project_is_rejected(project, target, names):
    link = project / ("masks/link" if "link" in names else names[0])
    link.symlink_to(target if target.startswith("/") else project / target)
    with pytest.raises(DataError) as caught:
        checked_path(project, *names)
    assert str(link) in caught.value.sentence and "is a link to" in caught.value.sentence and caught.value.hint


@LINKS
def test_links_within_the_folder_are_followed_except_cycles(project, tmp_path):
    (project / "planes").symlink_to("masks")
    (tmp_path / "shortcut").symlink_to(project)
    assert checked_path(tmp_path / "shortcut", "planes", "r_0.npz") == tmp_path / "shortcut" / "planes" / "r_0.npz"
    (project / "a").symlink_to("b")
    (project / "b").symlink_to("a")
    with pytest.raises(DataError, match="is a link to b"):
        checked_path(project, "a", "x.png")


@LINKS
def test_tree_with_a_link_that_leaves_it_is_rejected(project):
    (project / "masks" / ".tmp.sync").symlink_to("nowhere")
    assert check_tree(project, project / "masks") == project / "masks"
    (project / "masks" / "pot" / "r_0.png").symlink_to(project.parent / "secret.txt")
    with pytest.raises(DataError, match=r"masks/pot/r_0\.png is a link"):
        check_tree(project, project / "masks")
