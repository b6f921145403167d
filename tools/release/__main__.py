"""Build the release into a folder: `python -m tools.release [--out DIR]`. Needs Python 3.11 and nothing else."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from tools.evaluate.pages import stale_tables
from tools.release.manifest import read_manifest
from tools.release.packing import packed_files, write_zip
from tools.release.repository import LIST, sha256, write_checksums, write_repository
from tools.release.validation import validate

ROOT = Path(__file__).resolve().parents[2]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=ROOT / "dist", help="folder (default: dist)")
    parser.add_argument("--draft", action="store_true", help="build even where published tables are stale")
    options = parser.parse_args()
    stale = {} if options.draft else stale_tables()
    for name, modules in stale.items():
        print(f"error: the table {name} is stale: {', '.join(modules) or 'never measured'}", file=sys.stderr)
    if stale:
        print("Measure them by tools/dev.py evaluate, or build a draft: tools/dev.py build --draft.", file=sys.stderr)
        return 1
    return build(ROOT, options.out)


def build(root: Path, out: Path) -> int:
    """Pack the extension of a checkout, list it as a repository, write checksums, and validate the package.

    Returns:
        The exit code.
    """
    manifest = read_manifest(root)
    out.mkdir(parents=True, exist_ok=True)
    package = out / f"{manifest['id']}-{manifest['version']}.zip"
    write_zip(package, root, packed_files(root, manifest["build"]["paths_exclude_pattern"]))
    repository = out / "repository"
    write_repository(repository, package, manifest)
    write_checksums(out / "SHA256SUMS", [package, repository / package.name, repository / LIST])
    print(f"{package}: {package.stat().st_size / 1000:.0f} kB, SHA-256 {sha256(package)}")
    return validate(root, package)


if __name__ == "__main__":
    sys.exit(main())
