"""Captures whose masks are known: four procedural scenes with true recolors, and real ones."""
