"""Programs around the engine and the extension; neither imports any of them. Run them from the repository's root.

For everyone: `dev.py` (set up, demo, test, build and all below), `benchmark.py` (measured times), `cells.py` (what the
tests are run on beside `requirements/`).

- `demo/`: the main job through real Blender, its judge, and the maker of its capture
- `scenes/`: captures with known truth: made, learned and judged
- `experiments/`: the paper's tables, and the page that shows them
- `release/`: the extension's zip, its repository and checksums, without Blender
- `window/`: real Blender used by mouse and keys

These share `judging/` (held-out views against the truth), `procedural/` (captures made with Cycles) and `speed/` (what
`benchmark.py` measures).
"""
