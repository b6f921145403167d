"""Programs around the engine and the extension; neither imports any of them. Run them from the repository's root.

`dev.py` has a verb for everything: set up, demo, test, evaluate, build. `cells.py` lists what the tests are run on beside
`requirements/`.

- `demo/`: the main job through real Blender, its judge, and the maker of its capture
- `scenes/`: captures with known truth, drawn by Cycles from a seed
- `metrics/`: the metrics of all tables, and the truth of captures
- `evaluate/`: every published table and figure, and the pages that show them
- `release/`: the extension's zip, its repository and checksums, without Blender
- `window/`: real Blender used by mouse and keys
"""
