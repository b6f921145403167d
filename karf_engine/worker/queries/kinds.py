"""The kinds of queries: each is a function of the session and the query's options."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from .chart import chart
from .correct import correct
from .harmonics import harmonics
from .inspect import inspect
from .masks import masks
from .preview import preview
from .propose import propose
from .session import Session
from .show import show

# kind -> function; it returns JSON values, paths as text. What needs torch or more is imported in it
QUERIES: dict[str, Callable[[Session, dict[str, Any]], dict[str, Any]]] = {
    "chart": chart,
    "correct": correct,
    "harmonics": harmonics,
    "inspect": inspect,
    "masks": masks,
    "preview": preview,
    "propose": propose,
    "show": show,
}
