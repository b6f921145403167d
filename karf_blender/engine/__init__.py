"""The engine as a program: its Python, its child processes, one job of it. Knows nothing of scenes."""
