"""The tables of tools/evaluate.py, on the demo capture. The caller puts tools/ and the repository's root on the path."""
