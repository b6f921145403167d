"""Captures whose masks are known: seven procedural scenes with true recolors, and real ones."""
