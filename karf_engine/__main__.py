"""`python -m karf_engine ...`, and `python -I path/to/karf_engine ...` for a caller that sets no import path."""

import os
import sys

if sys.version_info < (3, 11):  # noqa: UP036 - before importing anything that an older Python cannot parse
    version = f"{sys.version_info[0]}.{sys.version_info[1]}"
    sys.stderr.write(
        f"error: {sys.executable} is Python {version}, and the engine needs 3.11 or newer: choose another.\n"
    )
    sys.exit(3)

if not __package__:
    # run as a folder: load it as the package karf_engine without putting its modules on the path
    from importlib.util import module_from_spec, spec_from_file_location
    from pathlib import Path

    folder = Path(__file__).resolve().parent
    sys.path[:] = [entry for entry in sys.path if not entry or Path(entry).resolve() != folder]
    spec = spec_from_file_location("karf_engine", folder / "__init__.py", submodule_search_locations=[str(folder)])
    assert spec is not None and spec.loader is not None
    package = module_from_spec(spec)
    sys.modules["karf_engine"] = package
    spec.loader.exec_module(package)

from karf_engine.cli import main

if __name__ == "__main__":
    code = main()
    try:
        sys.stdout.flush()
        sys.stderr.flush()
    finally:
        os._exit(code)  # skips torch's teardown, which takes a second
