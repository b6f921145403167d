"""Published tables: their sources, staleness, pages, and the order of evaluation jobs."""

import shutil
import subprocess
import sys

import pytest

from tools.evaluate import pages, sources, table
from tools.evaluate.jobs import JOBS, TABLES, to_run
from tools.evaluate.store import Store
from tools.metrics import METRICS
from tools.metrics.truth import Truth

STORED = {name: stored for name in TABLES if (stored := table.read(name))}
NO_CODE = "# empty\n"


def test_pages_show_all_stored_tables():
    shown = {path: path.read_text(encoding="utf-8") for path in pages.PAGES}
    assert shown == pages.texts(), "run python3 tools/dev.py evaluate --pages"
    assert set(pages.shown_tables(shown[pages.PAGES[1]])) == set(TABLES)


@pytest.mark.parametrize("name", STORED)
def test_stored_table_has_full_rows_and_an_origin(name):
    rows, made = STORED[name]["rows"], STORED[name]["made"]
    assert rows and all(len(row) == 1 + len(STORED[name]["columns"]) for row in rows)
    assert made["sources"] and " " not in made["commit"]


@pytest.fixture
def checkout(tmp_path):
    """A copy of all files that tables depend on."""
    for folder in (sources.ROOT / "karf_engine", sources.ROOT / "tools", table.FOLDER):
        if folder.exists():
            shutil.copytree(folder, tmp_path / folder.relative_to(sources.ROOT))
    return tmp_path


@pytest.mark.parametrize(
    ("module", "stale", "fresh"),
    [
        ("recolor/matting/photo_mattes.py", {"outside", "edits", "segmentation"}, {"ablations", "consistency"}),
        ("palettes/matching/becomes.py", {"outside", "edits", "consistency"}, {"segmentation", "ablations"}),
        ("metrics/images.py", {"outside", "edits", "ablations"}, {"segmentation", "consistency"}),
        ("kan/gated_block.py", {"outside", "ablations", "segmentation"}, {"kernels"}),
    ],
)
def test_changed_module_makes_only_its_tables_stale(checkout, module, stale, fresh):
    name, before = f"karf_engine/{module}", set(pages.stale_tables(checkout))
    file = checkout / name
    file.write_text(file.read_text(encoding="utf-8") + "\nNEW = 1\n")
    after = {table for table, modules in pages.stale_tables(checkout).items() if name in modules}
    assert stale & set(STORED) <= after and not fresh & after
    file.write_text(NO_CODE)
    assert before <= set(pages.stale_tables(checkout))


def test_stale_table_stops_a_release(checkout):
    (checkout / "karf_engine/metrics/masks.py").write_text(NO_CODE)
    command = [sys.executable, "-m", "tools.release", "--release", "--out", str(checkout / "dist")]
    done = subprocess.run(command, cwd=checkout, capture_output=True, text=True)
    assert done.returncode == 1 and "error: the table segmentation is stale" in done.stderr
    assert not (checkout / "dist").exists()


def test_comments_docstrings_and_formatting_do_not_matter(tmp_path):
    def digest(text):
        (tmp_path / "area.py").write_text(text)
        return sources.digest(tmp_path / "area.py")

    first = digest('def area(r):\n    """Return the area."""\n    return 3 * r**2\n')
    second = digest('def area( r ):\n    """Another sentence."""\n    # a comment\n    return (3 * r ** 2)\n')
    assert first == second != digest("def area(r):\n    return 4 * r**2\n")


def test_sources_are_modules_run_or_used_for_constants():
    trace = sources.Trace()
    trace.start()
    Truth()
    trace.stop()
    assert "tools/metrics/truth.py" in trace.modules() and "tools/evaluate/edits.py" not in trace.modules()
    fused = "karf_engine/fields/voxels/fused"
    assert f"{fused}/arrays.py" in sources.constants_of(f"{fused}/frozen.py")


def test_result_is_made_again_when_its_modules_change(tmp_path):
    store, made, module = Store(tmp_path), [], "tools/metrics/__init__.py"
    store.sources = {module: "not of this"}

    def make(folder):
        made.append(folder)
        store.sources = {module: sources.digest(sources.ROOT / module)}
        return {"iou": 0.5}

    assert [store.take("thing", make) for _ in range(2)] == [{"iou": 0.5}] * 2 and len(made) == 1
    record = tmp_path / "thing" / "made.json"
    record.write_text(record.read_text().replace(f'"{module}": "', f'"{module}": "0'))
    assert not store.is_current("thing")
    store.take("thing", make)
    assert len(made) == 2


def test_jobs_follow_their_needs_and_skip_current_tables():
    order = to_run(list(JOBS), lambda name: False)
    assert order == list(JOBS)
    assert all(order.index(need) < order.index(name) for name, job in JOBS.items() for need in job.needs)
    assert to_run(["outside"], lambda name: False) == ["demo", "outside"]
    assert to_run(["outside", "edits"], lambda name: name == "outside") == ["demo", "edits"]
    assert to_run(["outside"], lambda name: name == "outside") == []


def test_cells_have_their_metrics_format(monkeypatch):
    made = {"date": "2026-01-02", "commit": "0123456789", "seconds": 3, "sources": {}}
    rows = table.Table("way", {"ours": {"mse_outside": 0.000123, "seed 1": "a"}, "paper": {"seed 1": "b"}}).content()
    monkeypatch.setattr(pages, "read", lambda name: rows | {"made": made})
    text = pages.markdown("outside")
    assert "| way | MSE outside | seed 1 |\n| --- | --: | --: |\n| ours | 1.2e-04 | a |\n| paper |  | b |" in text
    assert "commit 0123456789" in text and METRICS["mse_outside"].meaning in pages.meanings(["outside"])
