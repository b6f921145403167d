"""The tables of docs/reliability.md are exactly what the committed reports give, and they promise what they must."""

import json

import pytest

from tools.reliability import page

REPORTS = [path for name in page.NAMES if (path := page.FOLDER / f"{name}.json").exists()]


def test_the_page_is_what_the_reports_give():
    assert page.PAGE.read_text(encoding="utf-8") == page.page(), "run python3 -m tools.reliability.page"


def test_the_page_has_a_place_for_every_table():
    text = page.PAGE.read_text(encoding="utf-8")
    for name in page.NAMES:
        assert f"<!-- {name} -->" in text and f"<!-- /{name} -->" in text


@pytest.mark.parametrize("path", REPORTS, ids=lambda path: path.stem)
def test_nothing_is_lost_in_the_committed_reports(path):
    for row in json.loads(path.read_text(encoding="utf-8"))["rows"]:
        assert not row.get("failures") and not row.get("findings"), row
