"""Write measured tables and figures into pages, between two comments, from docs/results/*.json.

    <!-- table: NAME --> ... <!-- /table -->        the table, and where it comes from
    <!-- figures: NAME --> ... <!-- /figures -->    sentences with figures of tables, see `FIGURES`
    <!-- metrics --> ... <!-- /metrics -->          what the columns of the page's tables are

Standard library only.
"""

from __future__ import annotations

import re
import textwrap
from collections.abc import Callable
from pathlib import Path
from typing import Any

from ..metrics import METRICS
from .jobs import TABLES
from .sources import ROOT, changed
from .table import FOLDER, Cell, read

PAGES = (ROOT / "README.md", ROOT / "docs" / "benchmark.md")
BLOCK = re.compile(r"(<!-- (table|figures|metrics)(?:: (\w+))? -->\n).*?(<!-- /\2 -->)", re.DOTALL)


def write() -> None:
    """Write all pages again."""
    for path, text in texts().items():
        path.write_text(text, encoding="utf-8")


def texts() -> dict[Path, str]:
    """Return the text of every page, with its tables as they are stored."""
    return {path: filled(path.read_text(encoding="utf-8")) for path in PAGES}


def filled(page: str) -> str:
    """Return a page whose blocks are filled anew."""
    kinds: dict[str, Callable[[str], str]] = {
        "table": markdown,
        "figures": lambda name: FIGURES[name](),
        "metrics": lambda _: meanings(shown_tables(page)),
    }
    return BLOCK.sub(lambda block: f"{block[1]}{kinds[block[2]](block[3])}\n{block[4]}", page)


def shown_tables(page: str) -> list[str]:
    """Return the names of the tables that a page shows."""
    return [block[3] for block in BLOCK.finditer(page) if block[2] == "table"]


def markdown(name: str) -> str:
    """Return a table as Markdown, and below it where it comes from."""
    table = read(name)
    if not table:
        return f"*Not measured yet: `python3 tools/dev.py evaluate {name}`.*"
    metrics = [METRICS.get(column) for column in table["columns"]]
    titles = [metric.title if metric else column for metric, column in zip(metrics, table["columns"], strict=True)]
    lines = [line([table["label"], *titles]), line(["---", *["--:"] * len(titles)])]
    for label, *cells in table["rows"]:
        formats = (metric.format if metric else "" for metric in metrics)
        lines.append(line([label, *map(cell_text, cells, formats)]))
    made = table["made"]
    origin = f"`python3 tools/dev.py evaluate {name}`, {made['date']}, commit {made['commit']}, {made['seconds']} CPU s"
    return "\n".join([*lines, "", f"<sub>{origin}</sub>"])


def line(cells: list[str]) -> str:
    return f"| {' | '.join(cells)} |"


def cell_text(cell: Cell, form: str) -> str:
    """Return a cell as shown; what was not measured is empty."""
    if cell is None:
        return ""
    return cell if isinstance(cell, str) else format(cell, form)


def meanings(names: list[str]) -> str:
    """Return a list of what the columns of these tables are."""
    columns = {
        column: METRICS[column] for name in names for column in read(name).get("columns", ()) if column in METRICS
    }
    return "\n".join(f"- *{metric.title}*: {metric.meaning}." for metric in columns.values() if metric.meaning)


def value(name: str, row: str, column: str) -> Any:
    """Return one cell of a stored table; row: the beginning of its label, without emphasis."""
    table = read(name)
    place = 1 + table["columns"].index(column)
    return next(cells[place] for cells in table["rows"] if cells[0].replace("*", "").startswith(row))


def stale_tables(root: Path = ROOT) -> dict[str, list[str]]:
    """Return the tables that are not of this version, each with the modules that have changed since; [] if unmeasured."""
    found = {}
    for name in TABLES:
        table = read(name, root / FOLDER.relative_to(ROOT))
        modules = changed(table["made"]["sources"], root) if table else []
        if modules or not table:
            found[name] = modules
    return found


def readme_figures() -> str:
    """Return the README's sentences: ours beside the strongest rule of others, on scenes that nobody chose."""
    needed = ("drawn", "rivals", "kernels")
    if not all(map(read, needed)):
        return f"*Not measured yet: `python3 tools/dev.py evaluate {' '.join(needed)}`.*"
    rivals = {row[0]: row[1:3] for row in read("rivals")["rows"] if "ours" not in row[0]}
    strongest = min(rivals, key=lambda rule: rivals[rule][0])
    mean, median = rivals[strongest]
    text = (
        f"On [twenty scenes that a seed draws](docs/benchmark.md), recolored photos are "
        f"{value('drawn', 'mean', 'ciede2000_per_paint'):.1f} CIEDE2000 from the true ones, told a color pair for each paint, "
        f"and {value('drawn', 'mean', 'ciede2000_per_object'):.1f} told one for each object (median "
        f"{value('drawn', 'median', 'ciede2000_per_object'):.1f}). The strongest rule of others ({strongest}) reaches "
        f"{mean:.1f} (median {median:.1f}). One rough mask gives an IoU of {value('drawn', 'mean', 'iou_photo'):.1f} % in "
        f"photos. Compiled kernels learn the demo's geometry {value('kernels', 'compiled', 'times_faster'):.1f} times faster."
    )
    return textwrap.fill(text, 120, break_long_words=False, break_on_hyphens=False)


FIGURES: dict[str, Callable[[], str]] = {"readme": readme_figures}
