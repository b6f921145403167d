"""A worker's loop of queries: one event for each query, when it ends, and the session's cache."""

import itertools
import queue
import threading
import time
from unittest.mock import Mock

import pytest

from karf_engine.errors import DataError, OutOfMemory
from karf_engine.worker import queries
from karf_engine.worker.loop import Worker
from karf_engine.worker.path_map import PathMap
from karf_engine.worker.protocol import WARM, EventReader, Query, Request, folder_line
from karf_engine.worker.queries.session import MAX_CACHED, Session


@pytest.fixture
def kinds(monkeypatch):
    """The known kinds of queries: `echo` answers with its options."""
    kinds = {"echo": lambda session, options: {"options": options}}
    monkeypatch.setattr(queries, "QUERIES", kinds)
    return kinds


class RunningWorker(threading.Thread):
    """A worker thread that answers the queries of a job; `write(None)` closes its standard input."""

    def __init__(self, folder, path_map=(), **options):
        super().__init__(daemon=True)
        self.code, self._job, self._lines = None, folder / "job", queue.SimpleQueue()
        self._worker, self.write = Worker(PathMap.of(path_map)), self._lines.put
        Request(WARM, folder, options).write(self._job)
        self._reader, self._events = EventReader(self._job), []
        self.start()
        assert self.next()[0] == "hello"

    def run(self):
        self.code = self._worker.serve(self._job, iter(self._lines.get, None))

    def ask(self, number, kind="echo", **options):
        self.write(Query(number, kind, options).encode() + "\n")

    def next(self):
        """Return the next event after the first."""
        end = time.monotonic() + 20
        while not self._events:
            assert time.monotonic() < end, "no event"
            self._events += self._reader.poll()
            time.sleep(0.005)
        event = self._events.pop(0)
        return event.kind, event.values

    def wait(self):
        """Wait for the end of the thread; return the exit code."""
        self.join(20)
        assert not self.is_alive()
        return self.code


@pytest.fixture
def worker(tmp_path, kinds):
    return RunningWorker(tmp_path)


def test_queries_are_answered_by_number(worker):
    for number in (7, 8):
        worker.ask(number, n=number)
        assert worker.next() == ("answer", {"id": number, "options": {"n": number}})
    worker.write(None)
    assert worker.wait() == 0 and worker.next()[0] == "done"


def test_only_the_latest_waiting_query_of_a_kind_is_answered(worker, kinds):
    begun, go = threading.Event(), threading.Event()
    kinds["slow"] = lambda session, options: (begun.set(), go.wait(20), {})[-1]
    worker.ask(1, "slow")
    begun.wait(20)
    for number in (2, 3, 4):
        worker.ask(number, "echo")
    worker.ask(5, "slow")
    go.set()
    events = [worker.next() for _ in range(5)]
    assert [values["id"] for kind, values in events if kind == "dropped"] == [2, 3]
    assert [values["id"] for kind, values in events if kind == "answer"] == [1, 4, 5]


@pytest.mark.parametrize("why", ["later query", "caller gone"])
def test_unwanted_answer_is_stopped(worker, kinds, why):
    begun = threading.Event()

    def until_stopped(session, options):
        begun.set()
        while options.get("is_long"):
            session.check()
        return {}

    kinds["echo"] = until_stopped
    worker.ask(1, is_long=True)
    begun.wait(20)
    if why == "later query":
        worker.ask(2)
        assert [worker.next() for _ in range(2)] == [("dropped", {"id": 1}), ("answer", {"id": 2})]
    else:
        worker.write(None)
        worker.wait()


@pytest.mark.parametrize("end", [None, "cancel\n", folder_line("another job") + "\n"])
def test_worker_ends_on_end_of_input_cancel_or_another_job(worker, end):
    worker.write(end)
    assert worker.wait() == 0 and worker.next()[0] == "done"


def test_worker_ends_when_idle(tmp_path, kinds):
    assert RunningWorker(tmp_path, idle_minutes=0).wait() == 0


def test_failed_query_is_refused_and_the_next_is_answered(worker, kinds):
    kinds["fail"] = Mock(side_effect=DataError("a.png is missing.", "Find it."))
    worker.ask(0, "fail")
    assert worker.next() == ("refused", {"id": 0, "code": "data", "sentence": "a.png is missing.", "hint": "Find it."})
    worker.ask(1, "paint")
    kind, values = worker.next()
    assert kind == "refused" and "Unknown kind of query 'paint'" in values["sentence"]
    worker.ask(3)
    assert worker.next()[0] == "answer"


@pytest.mark.parametrize(
    "text",
    ["{", "[1]", "7", "[" * 100_000, '{"id": "1", "kind": "echo", "options": {}}', '{"id": 1, "kind": "echo"}'],
)
def test_malformed_lines_cause_a_warning_only(worker, text):
    worker.write(text + "\n")
    kind, values = worker.next()
    assert kind == "warning" and values["code"] == "request"
    worker.ask(1)
    assert worker.next()[0] == "answer"


def test_caller_paths_are_mapped_in_queries(tmp_path, kinds):
    seen = []
    kinds["echo"] = lambda session, options: seen.append(options) or {}
    worker = RunningWorker(tmp_path, ["/mnt/film=/srv/film", f"{tmp_path}={tmp_path}"])
    worker.ask(1, project="/mnt/film/pots", side=3)
    assert worker.next() == ("answer", {"id": 1})
    assert seen == [{"project": "/srv/film/pots", "side": 3}]


def test_out_of_memory_empties_the_cache(worker, kinds):
    made = []

    def hungry(session, options):
        session.cached("pots", "", lambda: made.append("anew"))
        if options["is_large"]:
            raise OutOfMemory("The computer ran out of memory.")
        return {}

    kinds["echo"] = hungry
    for number, is_large in enumerate((False, True, False)):
        worker.ask(number, is_large=is_large)
        _, values = worker.next()
        assert values.get("code") == ("memory" if is_large else None)
    assert made == ["anew", "anew"]


def test_cached_value_is_made_again_when_its_version_changes(tmp_path):
    session, made = Session(tmp_path), itertools.count()
    found = [session.cached("pots", version, lambda: next(made)) for version in "aabba"]
    assert found == [0, 0, 1, 1, 2]


def test_least_recently_used_value_is_dropped(tmp_path):
    session = Session(tmp_path)
    for name in range(MAX_CACHED):
        session.cached(name, "", lambda name=name: name)
    session.cached(0, "", lambda: "anew")
    session.cached("one more", "", lambda: "more")
    assert session.cached(0, "", lambda: "anew") == 0 and session.cached(1, "", lambda: "anew") == "anew"


def test_answer_files_are_distinct_and_below_the_session(tmp_path):
    session = Session(tmp_path)
    first, second = session.file("preview.npz"), session.file("preview.npz")
    assert first != second and first.parent == second.parent == tmp_path / "answers" and first.parent.is_dir()
