"""The tables and pictures of docs/results.md, measured on the demo capture."""
