"""Faults thrown at the engine: what is broken, how, and whether a project survives it (see `__main__`)."""
