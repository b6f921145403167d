"""The warm engine's loop, in this process: every ask gets one event, and what is loaded is loaded once."""

import io
import queue
import threading

import pytest

pytest.importorskip("numpy")

from karf_engine.errors import DataError, KarfError, OutOfMemory
from karf_engine.path_map import PathMap
from karf_engine.warm.answers import ANSWERS
from karf_engine.warm.serving import serve
from karf_engine.warm.session import MOST_HELD, Session
from karf_engine.wire import Ask

SAME_PATHS = PathMap()


def line(number, kind="echo", **options):
    return Ask(number, kind, options).encode() + "\n"


class Lines:
    """Standard input: lines as they are written, the end when it is closed."""

    def __init__(self):
        self._queue = queue.SimpleQueue()

    def write(self, text):
        self._queue.put(text)

    def close(self):
        self._queue.put(None)

    def __iter__(self):
        return iter(self._queue.get, None)


@pytest.fixture
def session(tmp_path):
    return Session(tmp_path)


@pytest.fixture
def stream():
    return Lines()


@pytest.fixture
def echoing(monkeypatch):
    monkeypatch.setitem(ANSWERS, "echo", lambda session, options: {"options": options})
    return ANSWERS


def run(session, lines, paths=SAME_PATHS, minutes=1.0):
    """The events of a loop over these lines."""
    events = []

    def explained(error):
        return error if isinstance(error, KarfError) else KarfError(f"Internal error: {error!r}.")

    serve(session, lines, lambda kind, **values: events.append((kind, values)), explained, paths, minutes)
    return events


class Beside(threading.Thread):
    """A loop beside the test; `events` of it as they come."""

    def __init__(self, session, lines):
        super().__init__(daemon=True)
        self.session, self.lines, self.events = session, lines, queue.Queue()
        self.start()

    def run(self):
        emit = lambda kind, **values: self.events.put((kind, values))  # noqa: E731
        serve(self.session, self.lines, emit, lambda error: error, SAME_PATHS, 1.0)

    def next(self):
        return self.events.get(timeout=20)


def test_every_ask_is_answered_by_its_number(session, stream, echoing):
    loop = Beside(session, stream)
    for number in (7, 8):
        stream.write(line(number, n=number))
        assert loop.next() == ("answer", {"id": number, "options": {"n": number}})
    stream.close()
    loop.join(20)
    assert not loop.is_alive()


def test_of_a_kind_only_the_latest_that_waits_is_answered(session, stream, echoing):
    begun, go = threading.Event(), threading.Event()

    def slow(session, options):
        begun.set()
        go.wait(20)
        return {}

    echoing["slow"] = slow
    loop = Beside(session, stream)
    stream.write(line(1, "slow"))
    begun.wait(20)
    for number in (2, 3, 4):
        stream.write(line(number, "echo"))
    stream.write(line(5, "slow"))
    go.set()
    events = [loop.next() for _ in range(5)]
    del echoing["slow"]
    assert [(kind, values["id"]) for kind, values in events if kind == "dropped"] == [("dropped", 2), ("dropped", 3)]
    assert [values["id"] for kind, values in events if kind == "answer"] == [1, 4, 5]


def test_an_answer_that_takes_long_stops_where_a_later_ask_of_its_kind_waits(session, stream, echoing):
    begun = threading.Event()

    def until_superseded(session, options):
        begun.set()
        while options.get("is_long"):
            session.check()
        return {}

    echoing["echo"] = until_superseded
    loop = Beside(session, stream)
    stream.write(line(1, is_long=True))
    begun.wait(20)
    stream.write(line(2))
    assert [loop.next() for _ in range(2)] == [("dropped", {"id": 1}), ("answer", {"id": 2})]


def test_an_answer_that_takes_long_stops_where_the_caller_is_gone(session, stream, echoing):
    begun = threading.Event()

    def endless(session, options):
        begun.set()
        while True:
            session.check()

    echoing["echo"] = endless
    loop = Beside(session, stream)
    stream.write(line(1))
    begun.wait(20)
    stream.close()
    loop.join(20)
    assert not loop.is_alive()


@pytest.mark.parametrize("end", ["", "cancel\n"])
def test_the_end_of_input_or_the_word_ends_it(session, end):
    assert run(session, io.StringIO(end)) == []


def test_nobody_asking_for_a_while_ends_it(session, stream):
    assert run(session, stream, minutes=0.001) == []


def test_what_fails_is_refused_in_a_sentence_and_the_next_is_answered(session, stream, echoing):
    def fail(session, options):
        raise {"data": DataError("a.png is missing.", "Find it."), "fault": ZeroDivisionError("ours")}[options["how"]]

    echoing["fail"] = fail
    events = Beside(session, stream)
    seen = []
    for number, how in enumerate(("data", "nothing of the kind")):
        stream.write(line(number, "fail" if number == 0 else "paint", how=how))
        seen.append(events.next())
    del echoing["fail"]
    assert seen[0] == ("refused", {"id": 0, "code": "data", "sentence": "a.png is missing.", "hint": "Find it."})
    assert seen[1][0] == "refused" and "Unknown kind of ask 'paint'" in seen[1][1]["sentence"]
    stream.write(line(3))
    assert events.next()[0] == "answer"


def test_lines_that_are_no_ask_are_warned_of_and_passed_over(session, stream, echoing):
    loop = Beside(session, stream)
    for text in ("{", "[1]", '{"id": "1", "kind": "echo", "options": {}}', '{"id": 1, "kind": "echo"}'):
        stream.write(text + "\n")
        kind, values = loop.next()
        assert kind == "warning" and values["code"] == "request"
    stream.write(line(1))
    assert loop.next()[0] == "answer"


def test_paths_of_the_caller_are_those_of_this_computer(session, stream, echoing):
    lines = iter([line(1, project="/mnt/film/pots", side=3)])
    paths = PathMap.of(["/mnt/film=/srv/film"])
    seen = []
    echoing["echo"] = lambda session, options: seen.append(options) or {}

    def held_open():
        yield from lines
        while not seen:  # the end of input would drop what waits
            pass

    run(session, held_open(), paths)
    assert seen == [{"project": "/srv/film/pots", "side": 3}]


# --- what is kept --------------------------------------------------------------------------------------------------
def test_a_thing_is_made_once_and_again_when_its_mark_changes(session):
    made = []

    def make():
        made.append(len(made))
        return made[-1]

    assert [session.held("pots", mark, make) for mark in ("a", "a", "b", "b", "a")] == [0, 0, 1, 1, 2]


def test_what_was_not_asked_for_longest_is_let_go(session):
    for name in range(MOST_HELD):
        session.held(name, "", lambda name=name: name)
    session.held(0, "", lambda: "anew")
    session.held("one more", "", lambda: "more")
    assert session.held(0, "", lambda: "anew") == 0 and session.held(1, "", lambda: "anew") == "anew"


def test_memory_that_ran_out_lets_all_go(session, stream, echoing):
    def hungry(session, options):
        raise OutOfMemory("The computer ran out of memory.")

    echoing["echo"] = hungry
    session.held("pots", "", lambda: "kept")
    loop = Beside(session, stream)
    stream.write(line(1))
    assert loop.next()[1]["code"] == "memory"
    assert session.held("pots", "", lambda: "anew") == "anew"


def test_files_of_answers_lie_below_the_session_and_each_is_another(session, tmp_path):
    first, second = session.file("preview.npz"), session.file("preview.npz")
    assert first != second and first.parent == second.parent == tmp_path / "answers" and first.parent.is_dir()
