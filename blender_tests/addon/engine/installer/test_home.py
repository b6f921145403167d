"""The engine's folder: its states, what may be claimed, what is removed, how much it takes."""

import json

import pytest


@pytest.fixture
def claimed(managed, tmp_path):
    """A folder that is KaRF's, with the environments `env` and, above it, `elsewhere`."""
    for environment in (tmp_path / "engine" / "env", tmp_path / "elsewhere"):
        python = managed.home.python_of(environment)
        python.parent.mkdir(parents=True)
        python.touch()
    mark = {"schema": managed.home.SCHEMA, "build": "cpu", "extras": ["photos", "fast"], "python": "3.11"}
    (tmp_path / "engine" / "karf-engine.json").write_text(json.dumps(mark | {"platform": "linux-x86_64"}))
    return tmp_path / "engine"


@pytest.mark.parametrize(
    ("installed", "state"),
    [
        (None, "unfinished"),
        ({}, "outdated"),  # of an earlier version, which had one environment
        ({"environment": "env"}, "outdated"),
        ({"environment": "env-2"}, "broken"),
        *(({"environment": name}, "unfinished") for name in ("../elsewhere", "env-x", "", 7, None)),
    ],
)
def test_status_follows_the_environment_named_in_installed_json(managed, claimed, installed, state):
    if installed is not None:
        content = {"schema": managed.home.SCHEMA, "torch": "2.0", "digest": "of other packages"}
        (claimed / "installed.json").write_text(json.dumps(content | installed))
    status = managed.home.status(claimed)
    assert (status.state, status.extras) == (state, ("photos",))  # earlier versions had numba as the extra `fast`
    python = managed.home.python_of(claimed / "env")
    assert managed.home.python_in(claimed) == (python if state == "outdated" else None)


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"schema": "karf-managed/9"}', None])
def test_a_folder_without_karfs_mark_is_neither_taken_nor_removed(managed, tmp_path, text):
    if text is not None:
        (tmp_path / "karf-engine.json").write_text(text)
    (tmp_path / "thesis.txt").write_text("years of work")
    assert managed.home.status(tmp_path).state == "none"
    with pytest.raises(managed.api.DataError, match="not of KaRF's engine"):
        managed.home.claim(tmp_path, {})
    with pytest.raises(managed.api.BadRequest, match="nothing was deleted"):
        managed.home.remove(tmp_path)
    assert (tmp_path / "thesis.txt").exists()


@pytest.mark.parametrize("below", ["", "engine"])
def test_a_path_that_is_a_file_is_named(managed, tmp_path, below):
    file = tmp_path / "engine.txt"
    file.write_text("")
    with pytest.raises(managed.api.DataError, match=r"engine\.txt is a file"):
        managed.home.check_free(file / below)


def test_remove_follows_no_links_and_keeps_other_files(managed, install, place, tmp_path):
    install()
    (tmp_path / "films").mkdir()
    (tmp_path / "films" / "pots.blend").touch()
    (place / "env-7").symlink_to(tmp_path / "films", target_is_directory=True)
    (place / "env-old").mkdir()
    managed.home.remove(place)
    assert sorted(path.name for path in place.iterdir()) == ["env-7", "env-old"]
    assert (tmp_path / "films" / "pots.blend").exists() and managed.home.status(place).state == "none"


def test_hard_links_are_counted_once(managed, tmp_path):
    (tmp_path / "below").mkdir()
    (tmp_path / "below" / "one").write_bytes(b"x" * 1000)
    (tmp_path / "two").hardlink_to(tmp_path / "below" / "one")
    (tmp_path / "three").write_bytes(b"x" * 500)
    assert list(managed.home.measure(tmp_path))[-1] == 1500
