"""How much memory a piece of a test takes."""

from contextlib import contextmanager

import pytest

resource = pytest.importorskip("resource", reason="memory is measured, which Windows cannot")

MOST_GROWTH = 1 << 18  # kilobytes of resident memory


@contextmanager
def little_memory():
    """Fail where what is run within takes hundreds of megabytes."""
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    yield
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < MOST_GROWTH
