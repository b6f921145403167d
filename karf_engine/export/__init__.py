"""Output files: frames, layers, Cryptomatte mattes, points, tables, contact sheets."""
