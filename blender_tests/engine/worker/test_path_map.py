"""Paths of shared folders: whole folders of absolute paths are mapped, within sentences too, and nothing else."""

import json

import pytest

from karf_engine.worker.path_map import PathMap

TO_LINUX = ["/mnt/film=/srv/film"]
TO_WINDOWS = [r"Z:\film=/srv/film"]
FROM_WINDOWS = [r"/mnt/film=D:\film", r"/mnt/pots=\\server\pots"]
CHAIN = ["/mnt=/srv", "/data=/mnt"]
NAMED = [
    (TO_LINUX, "/srv/film", "/mnt/film"),
    (TO_LINUX, "/srv/film/a.png", "/mnt/film/a.png"),
    (TO_LINUX, "/srv/film.", "/mnt/film."),
    (TO_LINUX, "'/srv/film/a.png' and (/srv/film/b.png) are missing.", "'/mnt/film/a.png' and (/mnt/film/b.png) are missing."),
    (TO_LINUX, "out=/srv/film/a,/srv/film/b", "out=/mnt/film/a,/mnt/film/b"),
    (TO_LINUX, "missing:/srv/film/a", "missing:/mnt/film/a"),
    (TO_LINUX, json.dumps({"path": "/srv/film/a", "other": ["/data/srv/film/a"]}), json.dumps({"path": "/mnt/film/a", "other": ["/data/srv/film/a"]})),
    (TO_LINUX, {"path": "/srv/film/a", "other": ["/data/srv/film/a"]}, {"path": "/mnt/film/a", "other": ["/data/srv/film/a"]}),
    (TO_WINDOWS, "/srv/film/pots/a.png is empty.", r"Z:\film\pots\a.png is empty."),
    (FROM_WINDOWS, r"d:\Film\pots\a.png is empty.", "/mnt/film/pots/a.png is empty."),
    (FROM_WINDOWS, r"\\server\pots\a.png", "/mnt/pots/a.png"),
    (CHAIN, "/srv/a and /mnt/b", "/mnt/a and /data/b"),
]  # fmt: skip
OTHERS = [
    (TO_LINUX, "/data/srv/film"),
    (TO_LINUX, "/data/srv/film/a.png is missing."),
    (TO_LINUX, "/data (old)/srv/film"),
    (TO_LINUX, "../srv/film"),
    (TO_LINUX, "~/srv/film"),
    (TO_LINUX, "C:/srv/film"),
    (TO_LINUX, "file:///srv/film"),
    (TO_LINUX, "/srv/films"),
    (TO_LINUX, "/srv/film.old"),
    (FROM_WINDOWS, r"E:\old\D:\film"),
    (FROM_WINDOWS, r"D:\filmstrip"),
    ([], "/srv/film"),
]


@pytest.mark.parametrize(("folders", "ours", "theirs"), NAMED)
def test_paths_in_shared_folders_are_told_as_the_caller_knows_them(folders, ours, theirs):
    assert PathMap.of(folders).to_caller(ours) == theirs


@pytest.mark.parametrize(("folders", "text"), OTHERS)
def test_what_only_looks_like_a_shared_folder_stays(folders, text):
    assert PathMap.of(folders).to_caller(text) == text
