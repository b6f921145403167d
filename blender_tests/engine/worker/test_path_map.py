"""Paths of shared folders: whole folders of absolute paths are mapped, within sentences too, and nothing else."""

import json

import pytest

from karf_engine.errors import BadRequest
from karf_engine.worker.path_map import PathMap

TO_LINUX = ["/mnt/film=/srv/film"]
TO_WINDOWS = [r"Z:\film=/srv/film"]
FROM_WINDOWS = [r"/mnt/film=D:\film", r"/mnt/pots=\\server\pots"]
CHAIN = ["/mnt=/srv", "/data=/mnt"]
OURS = {"path": "/srv/film/a", "other": ["/data/srv/film/a"]}
THEIRS = {"path": "/mnt/film/a", "other": ["/data/srv/film/a"]}
NAMED = [
    (TO_LINUX, "/srv/film", "/mnt/film"),
    (TO_LINUX, "/srv/film/a.png", "/mnt/film/a.png"),
    (TO_LINUX, "/srv/film.", "/mnt/film."),
    (TO_LINUX, "'/srv/film/a' and (/srv/film/b) are missing.", "'/mnt/film/a' and (/mnt/film/b) are missing."),
    (TO_LINUX, "out=/srv/film/a,/srv/film/b", "out=/mnt/film/a,/mnt/film/b"),
    (TO_LINUX, "missing:/srv/film/a", "missing:/mnt/film/a"),
    (TO_LINUX, json.dumps(OURS), json.dumps(THEIRS)),
    (TO_LINUX, OURS, THEIRS),
    (TO_WINDOWS, "/srv/film/pots/a.png is empty.", r"Z:\film\pots\a.png is empty."),
    (FROM_WINDOWS, r"d:\Film\pots\a.png is empty.", "/mnt/film/pots/a.png is empty."),
    (FROM_WINDOWS, r"\\server\pots\a.png", "/mnt/pots/a.png"),
    (CHAIN, "/srv/a and /mnt/b", "/mnt/a and /data/b"),
]
OTHERS = [
    *("/data/srv/film", "/data/srv/film/a.png is missing.", "/data (old)/srv/film", "../srv/film", "~/srv/film"),
    *("C:/srv/film", "file:///srv/film", "/srv/films", "/srv/film.old"),
]
LOCAL = [
    (TO_LINUX, "/mnt/film", "/srv/film"),
    (["/mnt/film/=/srv/film/"], "/mnt/film/a/b.png", "/srv/film/a/b.png"),
    (TO_WINDOWS, r"z:\Film\a\b.png", "/srv/film/a/b.png"),
    ([r"\\nas\film=/srv/film"], r"\\nas\film\a.png", "/srv/film/a.png"),
    ([r"/srv/film=D:\film"], "/srv/film/a/b.png", r"D:\film\a\b.png"),
]


@pytest.mark.parametrize(("folders", "ours", "theirs"), NAMED)
def test_paths_in_shared_folders_are_told_as_the_caller_knows_them(folders, ours, theirs):
    assert PathMap.of(folders).to_caller(ours) == theirs


@pytest.mark.parametrize(
    ("folders", "text"),
    [
        *((TO_LINUX, text) for text in OTHERS),
        (FROM_WINDOWS, r"E:\old\D:\film"),
        (FROM_WINDOWS, r"D:\filmstrip"),
        ([], "/srv/film"),
    ],
)
def test_what_only_looks_like_a_shared_folder_stays(folders, text):
    assert PathMap.of(folders).to_caller(text) == text


@pytest.mark.parametrize(("folders", "caller", "here"), LOCAL)
def test_paths_of_the_caller_are_found_here(folders, caller, here):
    assert PathMap.of(folders).to_local(caller) == here


def test_a_folder_whose_name_only_begins_alike_is_refused():
    with pytest.raises(BadRequest, match="lies in no folder"):
        PathMap.of(TO_LINUX).to_local("/mnt/films/a.png")


@pytest.mark.parametrize("text", ["/mnt/film", "film=/srv/film", "/mnt/film=", "=/srv"])
def test_a_pair_that_is_none_is_refused(text):
    with pytest.raises(BadRequest, match="not a pair of folders"):
        PathMap.of([text])
