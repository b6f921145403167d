"""Faults thrown at the engine: what is broken, how, and whether a project survives it (see throw_faults.py)."""
