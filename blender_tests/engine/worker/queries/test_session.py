"""What is kept from one query to the next, and where answers lie."""

import pytest

pytest.importorskip("numpy")

from karf_engine.worker.queries.session import MAX_CACHED, Session


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
