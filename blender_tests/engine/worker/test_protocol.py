"""The job protocol: request and event files, errors, and the mapping of shared folders' paths."""

import json
from pathlib import Path

import pytest

from blender_tests.engine.reference.no_files import NO_FILES
from karf_engine.errors import ERROR_CLASSES, BadRequest, DataError, KarfError, error_from_code
from karf_engine.worker.path_map import PathMap
from karf_engine.worker.protocol import EVENTS_FILE, Event, EventReader, EventWriter, Request

GOOD = Event("done", 1, 2.0, {}).encode()


def test_request_survives_writing_and_reading(tmp_path):
    request = Request("render", Path("/some/project"), {"views": "test", "planes": True, "edit": None})
    path = request.write(tmp_path / "new" / "job")
    assert json.loads(path.read_text())["protocol"] == 1
    assert Request.read(tmp_path / "new" / "job") == request


UNREADABLE = r"request\.json is not a readable request"
VALID = {"protocol": 1, "stage": "palette", "project": "p"}
BAD_REQUESTS = [  # the file's bytes, changes to a valid request, or a function that makes something else; error, words
    *((text, DataError, UNREADABLE) for text in (b"", b"{", b"[]", b"7", b'{"protocol": 1}', b"\xff\xfe\x00")),
    (b"[" * 100_000, DataError, UNREADABLE),
    ({"project": 5}, DataError, UNREADABLE),
    ({"protocol": 2}, BadRequest, "protocol 2"),
    ({"stage": "painting"}, BadRequest, "Unknown stage 'painting'.*segmentation"),
    ({"stage": []}, BadRequest, r"Unknown stage \[\]"),
    (lambda path: None, DataError, r"request\.json does not exist"),
    *((make, DataError, r"request\.json is a .*, not a file") for make in NO_FILES),
]


@pytest.mark.parametrize(("content", "error", "words"), BAD_REQUESTS)
def test_malformed_requests_are_rejected_without_blocking(tmp_path, content, error, words):
    path = tmp_path / "request.json"
    if callable(content):
        content(path)
    else:
        path.write_bytes(json.dumps(VALID | content).encode() if isinstance(content, dict) else content)
    with pytest.raises(error, match=words):
        Request.read(tmp_path)


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


def test_incomplete_line_is_read_once_complete(tmp_path):
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
BAD_EVENTS = [
    *("{", "3", '"text"', "null", "[1, 2]", "[]", "{}", '{"t": "stage"}', "warning: stray", "[" * 100_000),
    *(event("done", time="noon"), event(["progress"], **PROGRESS), event("progress", **PROGRESS | {"step": "1"})),
    *(event("progress", **PROGRESS | {"total": None}), event("progress", **PROGRESS | {"metrics": [1]})),
    *(event("preview", path=5), event("error", code=4, sentence="x", hint=""), event("warning")),
    *(f"{MESSAGES}{text}}}" for text in ("5", "[]", "null", '{"sentence": 5}')),
    MESSAGES + '{"sentence": {"key": 5, "values": {}}}}',
    MESSAGES + '{"sentence": {"key": "{a}", "values": {"a": {"key": 1}}}}}',
    MESSAGES + '{"sentence": ' + '{"key": "{a}", "values": {"a": ' * 20_000,
]


@pytest.mark.parametrize("line", BAD_EVENTS, ids=range(len(BAD_EVENTS)))
def test_malformed_events_are_skipped(tmp_path, line):
    (tmp_path / EVENTS_FILE).write_text(f"{line}\n\n{GOOD}\n")
    assert [event.kind for event in EventReader(tmp_path).poll()] == ["done"]
    with pytest.raises(ValueError):
        Event.decode(line)


def test_event_of_earlier_versions_is_read():
    found = Event.decode('{"t": "warning", "n": 1, "time": 2.0, "code": "points", "sentence": "No {sparse} points."}')
    assert found["sentence"] == "No {sparse} points."


def test_errors_keep_class_and_exit_code():
    exit_codes = {}
    for error_class in ERROR_CLASSES:
        error = error_from_code(error_class.code, "What happened.", "What to do.")
        assert type(error) is error_class
        assert (error.sentence, error.hint) == ("What happened.", "What to do.")
        assert str(error) == "What happened. What to do."
        exit_codes[error.code] = error.exit_code
    assert exit_codes == {"request": 2, "dependency": 3, "data": 4, "memory": 5, "cancelled": 6, "diverged": 7}
    assert error_from_code("from the future", "Hm.").exit_code == KarfError.exit_code == 70


def test_long_error_sentences_are_truncated():
    error = BadRequest("The option views = " + "x" * 100_000, "Correct the request.")
    assert len(error.sentence) < 2000 and error.sentence.endswith(" ...")
    assert str(error).endswith("Correct the request.")


def test_error_event_keeps_message_keys_and_values(tmp_path):
    error = DataError("{path} has {share:.0%} of {name!r}.", "Ask for {name!r}.", path="a.png", share=0.25, name="pot")
    outer = DataError("{where}: {sentence}", error.hint, where="sheet.csv", sentence=error.sentence)
    EventWriter(tmp_path)("error", code=outer.code, sentence=outer.sentence, hint=outer.hint)
    (found,) = EventReader(tmp_path).poll()
    assert found["sentence"] == "sheet.csv: a.png has 25% of 'pot'." and found["hint"] == "Ask for 'pot'."
    assert found["sentence"].key == "{where}: {sentence}"
    assert found["sentence"].values["sentence"].key == "{path} has {share} of {name}."
    assert found["hint"].values == {"name": "'pot'"}


TO_LINUX = ["/mnt/film=/srv/film"]
TO_WINDOWS = [r"Z:\film=/srv/film"]
FROM_WINDOWS = [r"/mnt/film=D:\film", r"/mnt/pots=\\server\pots"]
CHAIN = ["/mnt=/srv", "/data=/mnt"]
LOCAL_JSON = {"path": "/srv/film/a", "other": ["/data/srv/film/a"]}
CALLER_JSON = {"path": "/mnt/film/a", "other": ["/data/srv/film/a"]}
MAPPED = [
    (TO_LINUX, "/srv/film", "/mnt/film"),
    (TO_LINUX, "/srv/film/a.png", "/mnt/film/a.png"),
    (TO_LINUX, "/srv/film.", "/mnt/film."),
    (TO_LINUX, "'/srv/film/a' and (/srv/film/b) are missing.", "'/mnt/film/a' and (/mnt/film/b) are missing."),
    (TO_LINUX, "out=/srv/film/a,/srv/film/b", "out=/mnt/film/a,/mnt/film/b"),
    (TO_LINUX, "missing:/srv/film/a", "missing:/mnt/film/a"),
    (TO_LINUX, json.dumps(LOCAL_JSON), json.dumps(CALLER_JSON)),
    (TO_LINUX, LOCAL_JSON, CALLER_JSON),
    (TO_WINDOWS, "/srv/film/pots/a.png is empty.", r"Z:\film\pots\a.png is empty."),
    (FROM_WINDOWS, r"d:\Film\pots\a.png is empty.", "/mnt/film/pots/a.png is empty."),
    (FROM_WINDOWS, r"\\server\pots\a.png", "/mnt/pots/a.png"),
    (CHAIN, "/srv/a and /mnt/b", "/mnt/a and /data/b"),
]
OTHERS = ["/data/srv/film", "/data/srv/film/a.png is missing.", "/data (old)/srv/film", "../srv/film", "~/srv/film"]
OTHERS += ["C:/srv/film", "file:///srv/film", "/srv/films", "/srv/film.old"]
SIMILAR = [  # paths that are not mapped
    *((TO_LINUX, text) for text in OTHERS),
    *((FROM_WINDOWS, text) for text in (r"E:\old\D:\film", r"D:\filmstrip")),
    ([], "/srv/film"),
]


@pytest.mark.parametrize(("folders", "local", "caller"), [*MAPPED, *((*row, row[1]) for row in SIMILAR)])
def test_only_shared_paths_are_mapped_to_the_caller(folders, local, caller):
    assert PathMap.of(folders).to_caller(local) == caller


@pytest.mark.parametrize(
    ("folders", "caller", "local"),
    [
        (TO_LINUX, "/mnt/film", "/srv/film"),
        (["/mnt/film/=/srv/film/"], "/mnt/film/a/b.png", "/srv/film/a/b.png"),
        (TO_WINDOWS, r"z:\Film\a\b.png", "/srv/film/a/b.png"),
        ([r"\\nas\film=/srv/film"], r"\\nas\film\a.png", "/srv/film/a.png"),
        ([r"/srv/film=D:\film"], "/srv/film/a/b.png", r"D:\film\a\b.png"),
    ],
)
def test_caller_paths_are_mapped_to_local_ones(folders, caller, local):
    assert PathMap.of(folders).to_local(caller) == local


def test_path_outside_shared_folders_is_rejected():
    with pytest.raises(BadRequest, match="lies in no folder"):
        PathMap.of(TO_LINUX).to_local("/mnt/films/a.png")


@pytest.mark.parametrize("text", ["/mnt/film", "film=/srv/film", "/mnt/film=", "=/srv"])
def test_malformed_folder_pairs_are_rejected(text):
    with pytest.raises(BadRequest, match="not a pair of folders"):
        PathMap.of([text])
