"""Build the release into a folder: `python -m tools.release [--out DIR]`. Needs Python 3.11 and nothing else."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from tools.release.manifest import read_manifest
from tools.release.packing import packed_files, write_zip
from tools.release.repository import LIST, sha256, write_checksums, write_repository
from tools.release.validation import validate

ROOT = Path(__file__).resolve().parents[2]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=ROOT / "dist", help="folder (default: dist)")
    return build(ROOT, parser.parse_args().out)


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
