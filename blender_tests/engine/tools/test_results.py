"""The committed results: pages are exactly what the data gives, and the data is complete."""

import importlib

import pytest

from karf_engine.project.settings import Settings, with_overrides
from tools.experiments import page

NAMES = [path.stem for path in sorted(page.FOLDER.glob("*.json")) if path.stem not in page.TEXTS]


@pytest.mark.parametrize("path", page.pages(), ids=lambda path: path.name)
def test_every_page_is_what_the_data_generates(path):
    assert path.read_text(encoding="utf-8") == page.pages()[path], "run python3 -m tools.experiments.page"


def test_every_table_of_the_paper_has_results():
    assert set(NAMES) == set(page.ORDER)


@pytest.mark.parametrize("name", NAMES)
def test_every_table_says_where_it_comes_from_and_has_full_rows(name):
    table = page.read(name)
    assert set(table["made"]) == {
        "date", "command", "preset", "version", "commit", "stages", "machine", "seconds"
    }  # fmt: skip
    assert table["rows"] and all(len(row) == len(table["columns"]) for row in table["rows"])


def test_every_picture_is_shown_and_says_what_it_shows(evaluate):
    captions = page.read("captions")
    assert {path.stem for path in page.FOLDER.glob("*.jpg")} == set(captions) == set(evaluate.STRIPS)
    assert all(f"](results/{name}.jpg)" in page.pages()[page.DOCS / "results.md"] for name in captions)


def test_remarks_speak_of_tables_that_exist():
    for name, remark in page.read("remarks").items():
        assert name in NAMES and remark["of"] and remark["text"]


def test_cells_are_shown_in_their_columns_format_and_missing_ones_as_a_dash():
    table = {
        "title": "T",
        "about": "About.",
        "made": {
            "date": "2026-01-02",
            "command": "c",
            "preset": "demo",
            "version": "1.0.0",
            "commit": "1234567",
            "machine": "m",
            "seconds": 3,
        },
        "columns": [{"title": "way", "format": ""}, {"title": "MSE", "format": ".1e"}],
        "rows": [["ours", 0.000123], ["paper", None]],
    }
    text = page.markdown("t", table, {"of": "2026-01-02", "text": "So it is."})
    assert "| way | MSE |\n| --- | --- |\n| ours | 1.2e-04 |\n| paper | - |" in text
    assert "*Remark on the run of 2026-01-02:* So it is." in text
    assert "version 1.0.0 at 1234567" in text and "Older than the code" not in text
    assert "**Older than the code:** So it was." in page.markdown("t", table, None, None, {"text": "So it was."})
    assert page.csv_text(table) == "way,MSE\nours,0.000123\npaper,\n"


@pytest.fixture
def evaluate():
    """The program that measures the tables."""
    pytest.importorskip("torch")
    return importlib.import_module("tools.experiments.evaluate")


@pytest.mark.parametrize("name", NAMES)
def test_a_table_older_than_its_settings_or_stages_says_so(name, evaluate):
    """Measure it again, or say in docs/results/outdated.json what is known of it, with the digests below."""
    stamp = importlib.import_module("tools.experiments.stamp")
    made, outdated = page.read(name)["made"], page.read("outdated").get(name, {})
    preset, *overrides = made["preset"].split()
    assert stamp.stages_of(preset, overrides) in (made["stages"], outdated.get("stages"))
    assert not outdated or (outdated["text"] and made["stages"] != outdated["stages"])


def test_a_changed_setting_or_version_makes_a_table_older(evaluate, monkeypatch):
    stamp = importlib.import_module("tools.experiments.stamp")
    before = stamp.stages_of("demo")
    changed = stamp.stages_of("demo", ["segmentation.rounds=4"])
    assert {name for name in before if before[name] != changed[name]} == {"segmentation"}
    monkeypatch.setitem(stamp.STAGE_VERSIONS, "splats", -1)
    assert {name for name in before if before[name] != stamp.stages_of("demo")[name]} == {"splats"}


def test_what_can_be_measured_is_what_the_page_shows(evaluate):
    assert (*evaluate.TABLES, "seeds", "rivals") == page.ORDER  # the last two have programs of their own


def test_every_ablation_is_a_plain_setting_and_differs_from_all_others(evaluate):
    settings = [
        with_overrides(Settings(), list(overrides))
        for overrides in importlib.import_module("tools.experiments.ablations").ABLATIONS.values()
    ]
    assert settings[0] == Settings()
    assert all(a != b for number, a in enumerate(settings) for b in settings[:number])
