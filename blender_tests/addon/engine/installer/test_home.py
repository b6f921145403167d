"""The engine's folder: its status, claiming, removal and size."""

import json

import pytest


@pytest.mark.parametrize(
    ("installed", "state"),
    [
        (None, "unfinished"),
        ({}, "outdated"),  # from a version with a single environment
        ({"environment": "env"}, "outdated"),
        ({"environment": "env-2"}, "broken"),
        *(({"environment": name}, "unfinished") for name in ("../elsewhere", "env-x", "", 7, None)),
    ],
)
def test_status_is_that_of_the_recorded_environment(managed, tmp_path, installed, state):
    folder = tmp_path / "engine"
    for environment in (folder / "env", tmp_path / "elsewhere"):
        python = managed.home.python_of(environment)
        python.parent.mkdir(parents=True)
        python.touch()
    mark = {"schema": managed.home.SCHEMA, "build": "cpu", "extras": ["photos", "fast"], "python": "3.11"}
    (folder / "karf-engine.json").write_text(json.dumps(mark | {"platform": "linux-x86_64"}))
    if installed is not None:
        content = {"schema": managed.home.SCHEMA, "torch": "2.0", "digest": "of other packages"}
        (folder / "installed.json").write_text(json.dumps(content | installed))
    status = managed.home.status(folder)
    assert (status.state, status.extras) == (state, ("photos",))  # `fast`, numba, was an extra once
    python = managed.home.python_of(folder / "env")
    assert managed.home.python_in(folder) == (python if state == "outdated" else None)


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"schema": "karf-managed/9"}', None])
def test_unmarked_folder_is_neither_claimed_nor_removed(managed, tmp_path, text):
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
def test_file_in_place_of_the_folder_is_named(managed, tmp_path, below):
    file = tmp_path / "engine.txt"
    file.write_text("")
    with pytest.raises(managed.api.DataError, match=r"engine\.txt is a file"):
        managed.home.check_free(file / below)


def test_remove_keeps_link_targets_and_other_files(managed, install, place, tmp_path):
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
