"""The job protocol: requests and events as files, read while they are written."""

import json
from pathlib import Path

import pytest

from blender_tests.engine.reference.no_files import NO_FILES
from karf_engine.errors import ERROR_CLASSES, BadRequest, DataError, KarfError, error_from_code
from karf_engine.worker.protocol import EVENTS_FILE, Event, EventReader, EventWriter, Request


def test_a_request_comes_back_as_it_was_written(tmp_path):
    request = Request("render", Path("/some/project"), {"views": "test", "planes": True, "edit": None})
    path = request.write(tmp_path / "new" / "job")
    assert json.loads(path.read_text())["protocol"] == 1
    assert Request.read(tmp_path / "new" / "job") == request


@pytest.mark.parametrize(
    "content", ["", "{", "[]", '{"protocol": 1}', '{"protocol": 1, "stage": "palette", "project": 5}', b"\xff\xfe\x00"]
)
def test_an_unreadable_request_is_a_data_error_naming_the_file(tmp_path, content):
    (tmp_path / "request.json").write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(DataError, match=r"request\.json is not a readable request"):
        Request.read(tmp_path)


def test_a_missing_request_is_a_data_error(tmp_path):
    with pytest.raises(DataError, match=r"request\.json"):
        Request.read(tmp_path)


def test_another_protocol_and_an_unknown_stage_are_refused(tmp_path):
    (tmp_path / "request.json").write_text('{"protocol": 2, "stage": "palette", "project": "p"}')
    with pytest.raises(BadRequest, match="protocol 2"):
        Request.read(tmp_path)
    (tmp_path / "request.json").write_text('{"protocol": 1, "stage": "painting", "project": "p"}')
    with pytest.raises(BadRequest, match="Unknown stage 'painting'") as caught:
        Request.read(tmp_path)
    assert "segmentation" in caught.value.hint


def test_events_arrive_in_order_with_their_values(tmp_path):
    writer, reader = EventWriter(tmp_path), EventReader(tmp_path)
    writer("stage", name="geometry")
    writer("progress", stage="geometry", step=1, total=2, metrics={"psnr": 20.5})
    first = list(reader.poll())
    writer("done")
    second = list(reader.poll())
    assert [event.kind for event in first + second] == ["stage", "progress", "done"]
    assert [event.number for event in first + second] == [0, 1, 2]
    assert first[1]["metrics"] == {"psnr": 20.5} and first[1].get("loss", -1) == -1
    assert [event.is_final for event in first + second] == [False, False, True]
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


@pytest.mark.parametrize("line", ["{", "3", '"text"', "null", "[1, 2]", "[]", "{}", '{"t": "stage"}', "warning: stray"])
def test_lines_that_are_no_event_are_passed_over(tmp_path, line):
    good = Event("done", 1, 2.0, {}).encode()
    (tmp_path / EVENTS_FILE).write_text(f"{line}\n\n{good}\n")
    assert [event.kind for event in EventReader(tmp_path).poll()] == ["done"]
    with pytest.raises(ValueError):
        Event.decode(line)


def test_errors_keep_their_class_across_the_border():
    exit_codes = {}
    for error_class in ERROR_CLASSES:
        error = error_from_code(error_class.code, "What happened.", "What to do.")
        assert type(error) is error_class
        assert (error.sentence, error.hint, str(error)) == (
            "What happened.",
            "What to do.",
            "What happened. What to do.",
        )
        exit_codes[error.code] = error.exit_code
    assert exit_codes == {"request": 2, "dependency": 3, "data": 4, "memory": 5, "cancelled": 6, "diverged": 7}
    assert error_from_code("from the future", "Hm.").exit_code == KarfError.exit_code == 70


# ------------------------------------------------------------------------------------------------- what a stranger wrote
@pytest.mark.parametrize("make", NO_FILES)
def test_what_lies_in_place_of_a_request_is_named_and_never_waited_for(tmp_path, make):
    make(tmp_path / "request.json")
    with pytest.raises(DataError, match=r"request\.json is a .*, not a file"):
        Request.read(tmp_path)


@pytest.mark.parametrize("content", ["[" * 100_000, '{"protocol": 1, "stage": [], "project": 5}', "[]", "7"])
def test_requests_of_another_shape_are_refused(tmp_path, content):
    (tmp_path / "request.json").write_text(content)
    with pytest.raises(DataError, match=r"request\.json"):
        Request.read(tmp_path)


@pytest.mark.parametrize(
    "event",
    [
        {"t": ["progress"]},
        {"t": "progress", "stage": "x", "step": "1", "total": 2, "metrics": {}},
        {"t": "progress", "stage": "x", "step": 1, "metrics": {}},
        {"t": "progress", "stage": "x", "step": 1, "total": 2, "metrics": [1]},
        {"t": "preview", "path": 5},
        {"t": "error", "code": 4, "sentence": "x", "hint": ""},
        {"t": "warning"},
    ],
)
def test_events_of_other_values_are_passed_over(tmp_path, event):
    good = Event("done", 1, 2.0, {}).encode()
    (tmp_path / EVENTS_FILE).write_text(f"{json.dumps(event | {'n': 0, 'time': 1.0})}\n{'[' * 100_000}\n{good}\n")
    assert [event.kind for event in EventReader(tmp_path).poll()] == ["done"]


def test_an_event_of_no_time_is_passed_over(tmp_path):
    (tmp_path / EVENTS_FILE).write_text(
        '{"t": "done", "n": 0, "time": "noon"}\n' + Event("done", 1, 2.0, {}).encode() + "\n"
    )
    assert [event.number for event in EventReader(tmp_path).poll()] == [1]


def test_a_sentence_that_quotes_without_end_is_cut_off():
    error = BadRequest("The option views = " + "x" * 100_000, "Correct the request.")
    assert (
        len(error.sentence) < 2000 and error.sentence.endswith(" ...") and str(error).endswith("Correct the request.")
    )


def test_a_message_keeps_its_key_and_values_on_its_way(tmp_path):
    error = DataError("{path} has {share:.0%} of {name!r}.", "Ask for {name!r}.", path="a.png", share=0.25, name="pot")
    outer = DataError("{where}: {sentence}", error.hint, where="sheet.csv", sentence=error.sentence)
    EventWriter(tmp_path)("error", code=outer.code, sentence=outer.sentence, hint=outer.hint)
    (event,) = EventReader(tmp_path).poll()
    assert event["sentence"] == "sheet.csv: a.png has 25% of 'pot'." and event["hint"] == "Ask for 'pot'."
    assert event["sentence"].key == "{where}: {sentence}"
    assert event["sentence"].values["sentence"].key == "{path} has {share} of {name}."
    assert event["hint"].values == {"name": "'pot'"}


def test_an_event_of_a_version_before_has_texts_alone():
    event = Event.decode('{"t": "warning", "n": 1, "time": 2.0, "code": "points", "sentence": "No {sparse} points."}')
    assert event["sentence"] == "No {sparse} points."


@pytest.mark.parametrize(
    "messages",
    [
        *("5", "[]", "null", '{"sentence": 5}', '{"sentence": {"key": 5, "values": {}}}'),
        '{"sentence": {"key": "{a}", "values": {"a": {"key": 1}}}}',
        '{"sentence": ' + '{"key": "{a}", "values": {"a": ' * 20_000,
    ],
    ids=range(7),
)
def test_an_event_whose_messages_are_damaged_is_passed_over(tmp_path, messages):
    known = '{"t": "warning", "n": 1, "time": 2.0, "code": "a", "sentence": "b", "messages": '
    (tmp_path / EVENTS_FILE).write_text(known + messages + "}\n", encoding="utf-8")
    assert list(EventReader(tmp_path).poll()) == []
