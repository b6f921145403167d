"""A limit on the memory that part of a test takes."""

from contextlib import contextmanager

import pytest

resource = pytest.importorskip("resource", reason="memory cannot be measured on Windows")

MOST_GROWTH = 1 << 18  # kilobytes of resident memory


@contextmanager
def little_memory():
    """Fail if the code within takes hundreds of megabytes."""
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    yield
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < MOST_GROWTH
