"""Compiled kernels on computers that keep nothing."""

import pytest

pytest.importorskip("numba")

from numba.core.caching import FunctionCache

from karf_engine.compute.kernels import kernel


def test_a_kernel_compiles_where_no_folder_can_be_written(monkeypatch):
    monkeypatch.setattr(FunctionCache._impl_class, "_locator_classes", [])  # numba finds no place for its files

    @kernel
    def double(x):
        return 2 * x

    assert double(21) == 42
