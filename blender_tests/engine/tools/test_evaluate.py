"""Published tables: their sources, when they are stale, what the pages show, and how parts follow one another."""

import shutil
import subprocess
import sys

import pytest

from tools.evaluate import pages, sources, table
from tools.evaluate.jobs import JOBS, TABLES, with_needed
from tools.evaluate.store import Store
from tools.metrics import METRICS
from tools.metrics.truth import Truth

MEASURED = [name for name in TABLES if table.read(name)]


@pytest.mark.parametrize("path", pages.PAGES, ids=lambda path: path.name)
def test_every_page_shows_what_is_stored(path):
    assert path.read_text(encoding="utf-8") == pages.texts()[path], "run python3 tools/dev.py evaluate --pages"


def test_the_benchmark_page_shows_every_table():
    assert set(pages.shown_tables(pages.PAGES[1].read_text(encoding="utf-8"))) == set(TABLES)


@pytest.mark.parametrize("name", MEASURED)
def test_a_stored_table_has_full_rows_and_an_origin_in_the_history(name):
    stored = table.read(name)
    assert stored["rows"] and all(len(row) == 1 + len(stored["columns"]) for row in stored["rows"])
    assert stored["made"]["sources"] and " " not in stored["made"]["commit"]


@pytest.fixture
def checkout(tmp_path):
    """A copy of everything that tables depend on."""
    for name in ("karf_engine", "tools"):
        shutil.copytree(sources.ROOT / name, tmp_path / name, ignore=shutil.ignore_patterns("__pycache__"))
    table.FOLDER.mkdir(exist_ok=True)
    shutil.copytree(table.FOLDER, tmp_path / table.FOLDER.relative_to(sources.ROOT), dirs_exist_ok=True)
    return tmp_path


@pytest.mark.parametrize(
    ("module", "stale", "fresh"),
    [
        ("karf_engine/recolor/matting/matte.py", {"outside", "edits", "segmentation"}, {"ablations", "kernels"}),
        (
            "karf_engine/palettes/matching/becomes.py",
            {"outside", "edits", "consistency"},
            {"segmentation", "ablations"},
        ),
        ("karf_engine/metrics/masks.py", {"segmentation"}, {"outside", "ablations"}),
        ("karf_engine/kan/gated_block.py", {"ablations", "segmentation"}, {"kernels"}),
    ],
)
def test_a_changed_module_makes_the_tables_stale_that_depend_on_it(checkout, module, stale, fresh):
    file, before = checkout / module, set(pages.stale_tables(checkout))
    file.write_text(file.read_text(encoding="utf-8").replace("import annotations", "import annotations\n\nNEW = 1", 1))
    after = {name for name, modules in pages.stale_tables(checkout).items() if module in modules}
    assert stale & set(MEASURED) <= after and not fresh & after
    file.write_text("# no code is left of it\n")
    assert before <= set(pages.stale_tables(checkout))


def test_a_release_is_refused_while_a_table_is_stale(checkout):
    (checkout / "karf_engine/metrics/masks.py").write_text("# no code is left of it\n")
    command = [sys.executable, "-m", "tools.release", "--release", "--out", str(checkout / "dist")]
    done = subprocess.run(command, cwd=checkout, capture_output=True, text=True)
    assert done.returncode == 1 and "error: the table segmentation is stale" in done.stderr
    assert not (checkout / "dist").exists()


def test_comments_docstrings_and_formatting_make_no_table_stale(tmp_path):
    texts = (
        'def area(r):\n    """Return the area."""\n    return 3 * r**2\n',
        'def area( r ):\n    """Another sentence."""\n    # a comment\n    return (3 * r ** 2)\n',
        "def area(r):\n    return 4 * r**2\n",
    )
    files = [tmp_path / f"{number}.py" for number in range(3)]
    for file, text in zip(files, texts, strict=True):
        file.write_text(text)
    first, second, third = map(sources.digest, files)
    assert first == second != third


def test_a_module_counts_where_its_functions_ran_or_its_constants_are_used():
    trace = sources.Trace()
    trace.start()
    Truth()
    trace.stop()
    assert "tools/metrics/truth.py" in trace.modules()
    assert "tools/evaluate/edits.py" not in trace.modules()
    assert "karf_engine/fields/voxels/fused/arrays.py" in sources.constants_of(
        "karf_engine/fields/voxels/fused/frozen.py"
    )


def test_a_result_is_made_once_and_again_when_its_modules_change(tmp_path):
    store, made = Store(tmp_path), []
    store.sources = {"tools/metrics/__init__.py": "not of this"}

    def make(folder):
        made.append(folder)
        store.sources = {"tools/metrics/__init__.py": sources.digest(sources.ROOT / "tools/metrics/__init__.py")}
        return {"iou": 0.5}

    assert [store.take("thing", make) for _ in range(2)] == [{"iou": 0.5}] * 2 and len(made) == 1
    record = tmp_path / "thing" / "made.json"
    record.write_text(record.read_text().replace('"tools/metrics/__init__.py": "', '"tools/metrics/__init__.py": "0'))
    assert not store.is_current("thing")
    store.take("thing", make)
    assert len(made) == 2


def test_parts_come_after_what_they_need():
    order = with_needed(list(JOBS))
    assert order == list(JOBS)
    assert all(order.index(need) < order.index(name) for name, job in JOBS.items() for need in job.needs)
    assert with_needed(["outside"]) == ["demo", "outside"]


def test_cells_are_shown_in_their_metric_s_format_and_missing_ones_empty(monkeypatch):
    made = {"date": "2026-01-02", "commit": "0123456789", "seconds": 3, "sources": {}}
    rows = table.Table("way", {"ours": {"mse_outside": 0.000123, "seed 1": "a"}, "paper": {"seed 1": "b"}}).content()
    monkeypatch.setattr(pages, "read", lambda name: rows | {"made": made})
    text = pages.markdown("outside")
    assert "| way | MSE outside | seed 1 |\n| --- | --: | --: |\n| ours | 1.2e-04 | a |\n| paper |  | b |" in text
    assert "commit 0123456789" in text
    assert METRICS["mse_outside"].meaning in pages.meanings(["outside"])
