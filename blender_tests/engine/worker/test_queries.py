"""A worker asked queries: each gets one event, a job that follows ends the wait, and a session keeps what it made."""

import queue
import threading
import time

import pytest

from karf_engine.errors import DataError, OutOfMemory
from karf_engine.worker import queries as kinds_module
from karf_engine.worker.loop import Worker
from karf_engine.worker.path_map import PathMap
from karf_engine.worker.protocol import WARM, EventReader, Query, Request, folder_line
from karf_engine.worker.queries.session import MAX_CACHED, Session

SAME_PATHS = PathMap()


def line(number, kind="echo", **options):
    return Query(number, kind, options).encode() + "\n"


class Lines:
    """Standard input: lines as they are written, the end when it is closed."""

    def __init__(self):
        self._queue = queue.SimpleQueue()

    def write(self, text):
        self._queue.put(text)

    def close(self):
        self.write(None)

    def __iter__(self):
        return iter(self._queue.get, None)


@pytest.fixture
def kinds(monkeypatch):
    """The kinds of queries: `echo` answers with its options."""
    kinds = {"echo": lambda session, options: {"options": options}}
    monkeypatch.setattr(kinds_module, "QUERIES", kinds)
    return kinds


class Beside(threading.Thread):
    """A worker beside the test, at a job that answers queries; `next()` is its next event after the first."""

    def __init__(self, folder, lines, paths=SAME_PATHS, **options):
        super().__init__(daemon=True)
        self.code, self._lines, self._job = None, lines, folder / "job"
        self._worker = Worker(paths)
        Request(WARM, folder, options).write(self._job)
        self._reader, self._events = EventReader(self._job), []
        self.start()
        assert self.next()[0] == "hello"

    def run(self):
        self.code = self._worker.serve(self._job, self._lines)

    def next(self):
        end = time.monotonic() + 20
        while not self._events:
            assert time.monotonic() < end, "no event"
            self._events += self._reader.poll()
            time.sleep(0.005)
        event = self._events.pop(0)
        return event.kind, event.values

    def ended(self):
        """Wait for its end; the exit code."""
        self.join(20)
        assert not self.is_alive()
        return self.code


@pytest.fixture
def stream():
    return Lines()


@pytest.fixture
def worker(tmp_path, stream, kinds):
    return Beside(tmp_path, stream)


def test_every_query_is_answered_by_its_number(worker, stream):
    for number in (7, 8):
        stream.write(line(number, n=number))
        assert worker.next() == ("answer", {"id": number, "options": {"n": number}})
    stream.close()
    assert worker.ended() == 0 and worker.next()[0] == "done"


def test_of_a_kind_only_the_latest_that_waits_is_answered(worker, stream, kinds):
    begun, go = threading.Event(), threading.Event()

    def slow(session, options):
        begun.set()
        go.wait(20)
        return {}

    kinds["slow"] = slow
    stream.write(line(1, "slow"))
    begun.wait(20)
    for number in (2, 3, 4):
        stream.write(line(number, "echo"))
    stream.write(line(5, "slow"))
    go.set()
    events = [worker.next() for _ in range(5)]
    assert [values["id"] for kind, values in events if kind == "dropped"] == [2, 3]
    assert [values["id"] for kind, values in events if kind == "answer"] == [1, 4, 5]


@pytest.mark.parametrize("why", ["a later query", "the caller is gone"])
def test_an_answer_that_takes_long_stops_where_nobody_waits_for_it(worker, stream, kinds, why):
    begun = threading.Event()

    def until_stopped(session, options):
        begun.set()
        while options.get("is_long"):
            session.check()
        return {}

    kinds["echo"] = until_stopped
    stream.write(line(1, is_long=True))
    begun.wait(20)
    if why == "a later query":
        stream.write(line(2))
        assert [worker.next() for _ in range(2)] == [("dropped", {"id": 1}), ("answer", {"id": 2})]
    else:
        stream.close()
        worker.ended()


@pytest.mark.parametrize("end", [None, "cancel\n", folder_line("another job") + "\n"])
def test_the_end_of_input_the_word_or_another_job_ends_it(worker, stream, end):
    stream.write(end)
    assert worker.ended() == 0 and worker.next()[0] == "done"


def test_no_query_for_a_while_ends_it(tmp_path, stream, kinds):
    assert Beside(tmp_path, stream, idle_minutes=0).ended() == 0


def test_what_fails_is_refused_in_a_sentence_and_the_next_is_answered(worker, stream, kinds):
    def fail(session, options):
        raise DataError("a.png is missing.", "Find it.")

    kinds["fail"] = fail
    stream.write(line(0, "fail"))
    assert worker.next() == ("refused", {"id": 0, "code": "data", "sentence": "a.png is missing.", "hint": "Find it."})
    stream.write(line(1, "paint"))
    kind, values = worker.next()
    assert kind == "refused" and "Unknown kind of query 'paint'" in values["sentence"]
    stream.write(line(3))
    assert worker.next()[0] == "answer"


@pytest.mark.parametrize(
    "text",
    ["{", "[1]", "7", "[" * 100_000, '{"id": "1", "kind": "echo", "options": {}}', '{"id": 1, "kind": "echo"}'],
)
def test_lines_that_say_nothing_are_warned_of_and_passed_over(worker, stream, text):
    stream.write(text + "\n")
    kind, values = worker.next()
    assert kind == "warning" and values["code"] == "request"
    stream.write(line(1))
    assert worker.next()[0] == "answer"


def test_paths_of_the_caller_are_those_of_this_computer(tmp_path, stream, kinds):
    seen = []
    kinds["echo"] = lambda session, options: seen.append(options) or {}
    worker = Beside(tmp_path, stream, PathMap.of(["/mnt/film=/srv/film", f"{tmp_path}={tmp_path}"]))
    stream.write(line(1, project="/mnt/film/pots", side=3))
    assert worker.next() == ("answer", {"id": 1})
    assert seen == [{"project": "/srv/film/pots", "side": 3}]


def test_memory_that_ran_out_lets_all_go(worker, stream, kinds):
    made = []

    def hungry(session, options):
        session.cached("pots", "", lambda: made.append("anew"))
        if options["is_large"]:
            raise OutOfMemory("The computer ran out of memory.")
        return {}

    kinds["echo"] = hungry
    for number, is_large in enumerate((False, True, False)):
        stream.write(line(number, is_large=is_large))
        _, values = worker.next()
        assert values.get("code") == ("memory" if is_large else None)
    assert made == ["anew", "anew"]


# ------------------------------------------------------------------------------------------------------------ a session
@pytest.fixture
def session(tmp_path):
    return Session(tmp_path)


def test_a_thing_is_made_once_and_again_when_its_mark_changes(session):
    made = []

    def make():
        made.append(len(made))
        return made[-1]

    assert [session.cached("pots", mark, make) for mark in ("a", "a", "b", "b", "a")] == [0, 0, 1, 1, 2]


def test_what_was_not_asked_for_longest_is_let_go(session):
    for name in range(MAX_CACHED):
        session.cached(name, "", lambda name=name: name)
    session.cached(0, "", lambda: "anew")
    session.cached("one more", "", lambda: "more")
    assert session.cached(0, "", lambda: "anew") == 0 and session.cached(1, "", lambda: "anew") == "anew"


def test_files_of_answers_lie_below_the_session_and_each_is_another(session, tmp_path):
    first, second = session.file("preview.npz"), session.file("preview.npz")
    assert first != second and first.parent == second.parent == tmp_path / "answers" and first.parent.is_dir()
