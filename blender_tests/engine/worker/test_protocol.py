"""The job protocol: requests and events as files, read while they are written, and paths of shared folders in them."""

import json
from pathlib import Path

import pytest

from blender_tests.engine.reference.no_files import NO_FILES
from karf_engine.errors import ERROR_CLASSES, BadRequest, DataError, KarfError, error_from_code
from karf_engine.worker.path_map import PathMap
from karf_engine.worker.protocol import EVENTS_FILE, Event, EventReader, EventWriter, Request

GOOD = Event("done", 1, 2.0, {}).encode()


# ------------------------------------------------------------------------------------------------------------- requests
def test_a_request_comes_back_as_it_was_written(tmp_path):
    request = Request("render", Path("/some/project"), {"views": "test", "planes": True, "edit": None})
    path = request.write(tmp_path / "new" / "job")
    assert json.loads(path.read_text())["protocol"] == 1
    assert Request.read(tmp_path / "new" / "job") == request


NO_REQUEST = r"request\.json is not a readable request"
KNOWN = {"protocol": 1, "stage": "palette", "project": "p"}
REFUSED = [  # the file's content, the error, words
    *((text, DataError, NO_REQUEST) for text in (b"", b"{", b"[]", b"7", b'{"protocol": 1}', b"\xff\xfe\x00")),
    (b"[" * 100_000, DataError, NO_REQUEST),
    (json.dumps(KNOWN | {"project": 5}).encode(), DataError, NO_REQUEST),
    (json.dumps(KNOWN | {"protocol": 2}).encode(), BadRequest, "protocol 2"),
    (json.dumps(KNOWN | {"stage": "painting"}).encode(), BadRequest, "Unknown stage 'painting'.*segmentation"),
    (json.dumps(KNOWN | {"stage": []}).encode(), BadRequest, r"Unknown stage \[\]"),
    (None, DataError, r"request\.json does not exist"),
    *((make, DataError, r"request\.json is a .*, not a file") for make in NO_FILES),
]


@pytest.mark.parametrize(("content", "error", "words"), REFUSED)
def test_what_is_no_request_is_named_and_never_waited_for(tmp_path, content, error, words):
    if isinstance(content, bytes):
        (tmp_path / "request.json").write_bytes(content)
    elif content is not None:
        content(tmp_path / "request.json")
    with pytest.raises(error, match=words):
        Request.read(tmp_path)


# --------------------------------------------------------------------------------------------------------------- events
def test_events_arrive_in_order_with_their_values(tmp_path):
    writer, reader = EventWriter(tmp_path), EventReader(tmp_path)
    writer("stage", name="geometry")
    writer("progress", stage="geometry", step=1, total=2, metrics={"psnr": 20.5})
    first = list(reader.poll())
    writer("done")
    events = first + list(reader.poll())
    assert [event.kind for event in events] == ["stage", "progress", "done"]
    assert [event.number for event in events] == [0, 1, 2]
    assert first[1]["metrics"] == {"psnr": 20.5} and first[1].get("loss", -1) == -1
    assert [event.is_final for event in events] == [False, False, True]
    assert list(reader.poll()) == []


def test_half_a_line_waits_for_its_other_half(tmp_path):
    reader = EventReader(tmp_path)
    assert list(reader.poll()) == []  # no file yet
    line = Event("stage", 0, 1.5, {"name": "ä"}).encode() + "\n"
    with (tmp_path / EVENTS_FILE).open("w", encoding="utf-8") as stream:
        stream.write(line[:20])
        stream.flush()
        assert list(reader.poll()) == []
        stream.write(line[20:])
        stream.flush()
        assert [event["name"] for event in reader.poll()] == ["ä"]


def event(kind, **values):
    return json.dumps({"t": kind, "n": 0, "time": 1.0} | values)


PROGRESS = {"stage": "x", "step": 1, "total": 2, "metrics": {}}
MESSAGES = '{"t": "warning", "n": 1, "time": 2.0, "code": "a", "sentence": "b", "messages": '
NONE = [
    *("{", "3", '"text"', "null", "[1, 2]", "[]", "{}", '{"t": "stage"}', "warning: stray", "[" * 100_000),
    *(event("done", time="noon"), event(["progress"], **PROGRESS), event("progress", **PROGRESS | {"step": "1"})),
    *(event("progress", **PROGRESS | {"total": None}), event("progress", **PROGRESS | {"metrics": [1]})),
    *(event("preview", path=5), event("error", code=4, sentence="x", hint=""), event("warning")),
    *(f"{MESSAGES}{text}}}" for text in ("5", "[]", "null", '{"sentence": 5}')),
    MESSAGES + '{"sentence": {"key": 5, "values": {}}}}',
    MESSAGES + '{"sentence": {"key": "{a}", "values": {"a": {"key": 1}}}}}',
    MESSAGES + '{"sentence": ' + '{"key": "{a}", "values": {"a": ' * 20_000,
]


@pytest.mark.parametrize("line", NONE, ids=range(len(NONE)))
def test_lines_that_are_no_event_are_passed_over(tmp_path, line):
    (tmp_path / EVENTS_FILE).write_text(f"{line}\n\n{GOOD}\n")
    assert [event.kind for event in EventReader(tmp_path).poll()] == ["done"]
    with pytest.raises(ValueError):
        Event.decode(line)


def test_an_event_of_a_version_before_has_texts_alone():
    found = Event.decode('{"t": "warning", "n": 1, "time": 2.0, "code": "points", "sentence": "No {sparse} points."}')
    assert found["sentence"] == "No {sparse} points."


# --------------------------------------------------------------------------------------------------------------- errors
def test_errors_keep_their_class_across_the_border():
    exit_codes = {}
    for error_class in ERROR_CLASSES:
        error = error_from_code(error_class.code, "What happened.", "What to do.")
        assert type(error) is error_class
        assert (error.sentence, error.hint) == ("What happened.", "What to do.")
        assert str(error) == "What happened. What to do."
        exit_codes[error.code] = error.exit_code
    assert exit_codes == {"request": 2, "dependency": 3, "data": 4, "memory": 5, "cancelled": 6, "diverged": 7}
    assert error_from_code("from the future", "Hm.").exit_code == KarfError.exit_code == 70


def test_a_sentence_that_quotes_without_end_is_cut_off():
    error = BadRequest("The option views = " + "x" * 100_000, "Correct the request.")
    assert len(error.sentence) < 2000 and error.sentence.endswith(" ...")
    assert str(error).endswith("Correct the request.")


def test_a_message_keeps_its_key_and_values_on_its_way(tmp_path):
    error = DataError("{path} has {share:.0%} of {name!r}.", "Ask for {name!r}.", path="a.png", share=0.25, name="pot")
    outer = DataError("{where}: {sentence}", error.hint, where="sheet.csv", sentence=error.sentence)
    EventWriter(tmp_path)("error", code=outer.code, sentence=outer.sentence, hint=outer.hint)
    (found,) = EventReader(tmp_path).poll()
    assert found["sentence"] == "sheet.csv: a.png has 25% of 'pot'." and found["hint"] == "Ask for 'pot'."
    assert found["sentence"].key == "{where}: {sentence}"
    assert found["sentence"].values["sentence"].key == "{path} has {share} of {name}."
    assert found["hint"].values == {"name": "'pot'"}


# ---------------------------------------------------------------------------------------------- paths of shared folders
TO_LINUX = ["/mnt/film=/srv/film"]
TO_WINDOWS = [r"Z:\film=/srv/film"]
FROM_WINDOWS = [r"/mnt/film=D:\film", r"/mnt/pots=\\server\pots"]
CHAIN = ["/mnt=/srv", "/data=/mnt"]
OURS = {"path": "/srv/film/a", "other": ["/data/srv/film/a"]}
THEIRS = {"path": "/mnt/film/a", "other": ["/data/srv/film/a"]}
MAPPED = [
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


@pytest.mark.parametrize(("folders", "ours", "theirs"), MAPPED)
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
