"""Captures whose masks are known: five procedural scenes with true recolors, and real ones."""
