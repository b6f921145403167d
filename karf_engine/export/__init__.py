"""Everything that is written for users: frames, layers, Cryptomatte mattes, points, tables, contact sheets."""
