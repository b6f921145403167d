"""The folder: what may be claimed, what is removed, how much it takes."""

import json

import pytest


def test_a_folder_of_others_is_neither_taken_nor_removed(managed, tmp_path):
    (tmp_path / "thesis.txt").write_text("years of work")
    with pytest.raises(managed.api.DataError, match="not of KaRF's engine"):
        managed.home.claim(tmp_path, {})
    with pytest.raises(managed.api.BadRequest, match="nothing was deleted"):
        managed.home.remove(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.txt"]


@pytest.mark.parametrize("below", ["", "engine"])
def test_a_path_that_is_a_file_is_named(managed, tmp_path, below):
    file = tmp_path / "engine.txt"
    file.write_text("")
    with pytest.raises(managed.api.DataError, match=r"engine\.txt is a file"):
        managed.home.check_free(file / below)


def test_remove_deletes_all_that_is_ours_follows_no_link_and_keeps_what_others_put_beside_it(
    managed, install, place, tmp_path
):
    install()
    install()
    (tmp_path / "films").mkdir()
    (tmp_path / "films" / "pots.blend").touch()
    (place / "env-7").symlink_to(tmp_path / "films", target_is_directory=True)
    (place / "env-old").mkdir()
    managed.home.remove(place)
    assert sorted(path.name for path in place.iterdir()) == ["env-7", "env-old"]
    assert (tmp_path / "films" / "pots.blend").exists() and managed.home.status(place).state == "none"


@pytest.mark.parametrize("name", ["../elsewhere", "env-x", "", 7, None])
def test_a_name_that_no_environment_has_counts_for_nothing(managed, install, place, name):
    install()
    installed = json.loads((place / "installed.json").read_text())
    (place / "installed.json").write_text(json.dumps(installed | {"environment": name}))
    assert managed.home.python_in(place) is None and managed.home.status(place).state == "unfinished"
    assert install().state == "ready"


def test_a_file_under_two_names_is_counted_once(managed, tmp_path):
    (tmp_path / "below").mkdir()
    (tmp_path / "below" / "one").write_bytes(b"x" * 1000)
    (tmp_path / "two").hardlink_to(tmp_path / "below" / "one")
    (tmp_path / "three").write_bytes(b"x" * 500)
    assert list(managed.home.measure(tmp_path))[-1] == 1500


def test_a_mark_that_is_damaged_is_nobodys(managed, tmp_path):
    for text in ("", "[]", "{}", '{"schema": "karf-managed/9"}'):
        (tmp_path / "karf-engine.json").write_text(text)
        assert managed.home.status(tmp_path).state == "none"
        with pytest.raises(managed.api.BadRequest):
            managed.home.remove(tmp_path)
