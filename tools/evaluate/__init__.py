"""The published tables and figures, measured by one command: `python3 tools/dev.py evaluate`.

sources (which modules a figure depends on) -> store (what is drawn and learned once) -> a module for each family of tables
-> jobs (all of them, in order) -> pages (docs/results/*.json, and the pages that show them).
"""
