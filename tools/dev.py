"""Set up, demo, test, evaluate, build: everything a developer or a curious user runs, with nothing but Python 3.11.

    python3 tools/dev.py demo [--out DIR]    the main job on the demo capture, through real Blender
    python3 tools/dev.py test                lint and all tests, in both environments (test -k WORD: engine tests by name)
    python3 tools/dev.py matrix [CELL ...]   the tests on other versions of Blender, Python, packages: docs/versions.md
    python3 tools/dev.py evaluate [PART ...] every published table and figure: docs/benchmark.md
    python3 tools/dev.py faults [-k NAME]    kills, full disks, damage thrown at the engine: docs/reliability.md
    python3 tools/dev.py fuzz [-k READER]    nearly right files for every reader: docs/reliability.md
    python3 tools/dev.py window [...]        the extension used by mouse and keys in a real window: docs/reliability.md
    python3 tools/dev.py build               the extension's zip, repository and checksums in dist/; sets nothing up
    python3 tools/dev.py wheel               the engine's wheel and source archive in dist/, checked
    python3 tools/dev.py page                the viewer of web pages for `karf export-page`; needs Node and npm
    python3 tools/dev.py docs                the documentation site in docs_out/; a warning is an error
    python3 tools/dev.py lock                the lock files from which uv makes the engine's environment
    python3 tools/dev.py setup               only the environments

Two environments are made under .venv/: `engine` has torch, `blender` has Blender as a module, as at a user's desk. The
verbs `wheel`, `docs` and `lock` make a small one each, `matrix` one for each of its cells. What is in them stands, to
the digit, in requirements/.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import shutil
import subprocess
import sys
import tempfile
import time
import venv
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
WEB = ROOT / "karf_engine" / "export" / "page" / "web"
# folders of the engine's tests that take about as long as all others
FIRST_HALF = ("capture", "cli", "commands", "compute", "export", "faults")
PASSING_ON = ("test", "matrix", "build", "evaluate", "faults", "fuzz", "window")  # verbs with another program's options
BARE = ("build", "matrix", "lock", "page")  # verbs that need no environment, or make their own
# of processes that are forked after numpy and torch were imported: they must find no other threads
ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")
BLENDER_LIBRARIES = (
    "libx11-6 libxrender1 libxxf86vm1 libxfixes3 libxi6 libxkbcommon0 libsm6 libice6 libgl1 libgomp1"  # Debian's names
)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    verbs = parser.add_subparsers(dest="verb", required=True)
    demo = verbs.add_parser("demo", help="the main job on the demo capture, through real Blender")
    demo.add_argument("--out", default="demo_out", help="where everything is written (default: %(default)s)")
    demo.add_argument("--threads", type=int, help="processor threads of the engine")
    for name, text in (
        ("test", "lint and all tests"),
        ("matrix", "the tests on other versions of Blender, Python and packages"),
        ("evaluate", "every published table and figure"),
        ("faults", "kills, full disks and damage thrown at the engine"),
        ("fuzz", "nearly right files for every reader"),
        ("window", "the extension used by mouse and keys in a real Blender window"),
    ):
        verb = verbs.add_parser(name, help=text)
        verb.add_argument("rest", nargs=argparse.REMAINDER, help="passed on")
    building = verbs.add_parser("build", help="the extension's zip, repository and checksums in dist/; sets nothing up")
    building.add_argument(
        "rest", nargs=argparse.REMAINDER, help="--release: for publishing, refuse while a published table is stale"
    )
    verbs.add_parser("wheel", help="the engine's wheel and source archive in dist/, checked")
    verbs.add_parser("page", help="the viewer of web pages for `karf export-page`; needs Node and npm")
    verbs.add_parser("docs", help="the documentation site in docs_out/; a warning is an error")
    verbs.add_parser("lock", help="lock the packages of the engine's environment for every system")
    verbs.add_parser("setup", help="only the environments")
    options, unknown = parser.parse_known_args()
    if unknown and options.verb not in PASSING_ON:
        parser.error(f"unknown arguments: {' '.join(unknown)}")
    if options.verb not in BARE:
        setup("engine", "blender")
    rest = unknown + list(getattr(options, "rest", []))
    actions = {
        "demo": run_demo,
        "test": run_tests,
        "matrix": run_matrix,
        "evaluate": run_evaluate,
        "faults": run_faults,
        "fuzz": run_fuzz,
        "window": run_window,
        "build": build,
        "wheel": wheel,
        "page": page,
        "docs": docs,
        "lock": lock,
    }
    return actions[options.verb](options, rest) if options.verb in actions else 0


# ---------------------------------------------------------------------------------------------------------- environments
def python_of(environment: str) -> Path:
    """The interpreter of an environment."""
    folder = ROOT / ".venv" / environment
    return folder / ("Scripts/python.exe" if os.name == "nt" else "bin/python")


def setup(*environments: str) -> None:
    """Make or update environments; each remembers the pinned packages that it was made from."""
    for environment in environments:
        pinned = ROOT / "requirements" / f"{environment}.txt"
        mark = ROOT / ".venv" / environment / "made-from.txt"
        digest = hashlib.sha256(pinned.read_bytes()).hexdigest()
        if mark.exists() and mark.read_text() == digest:
            continue
        start = time.monotonic()
        print(f"setting up .venv/{environment} ...", flush=True)
        venv.create(mark.parent, with_pip=True, symlinks=os.name != "nt")
        pip = [str(python_of(environment)), "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
        subprocess.run([*pip, "--requirement", str(pinned)], check=True)
        mark.write_text(digest)
        print(f"setting up .venv/{environment} took {time.monotonic() - start:.0f} s", flush=True)
    if "blender" in environments:
        _check_system_libraries()


def _check_system_libraries() -> None:
    """End with the names of the system's libraries where Blender lacks some."""
    probe = subprocess.run([str(python_of("blender")), "-c", "import bpy"], capture_output=True, text=True)
    if "cannot open shared object file" in probe.stderr:
        print(probe.stderr.strip().splitlines()[-1], file=sys.stderr)
        sys.exit(f"error: Blender needs system libraries; on Debian or Ubuntu: apt-get install {BLENDER_LIBRARIES}")


# ----------------------------------------------------------------------------------------------------------------- verbs
def run_demo(options: argparse.Namespace, rest: list[str]) -> int:
    """Learn and recolor the demo capture in Blender, then judge the frames against the true recolors."""
    out = Path(options.out).absolute()
    threads = ["--threads", str(options.threads)] if options.threads else []
    code = _run("blender", "-m", "tools.demo.run", "--out", str(out), *threads)
    if code:
        return code
    return _run("engine", "-m", "tools.demo.judge", "--out", str(out), *threads)


def run_tests(options: argparse.Namespace, rest: list[str]) -> int:
    """Format, lint and types, then the tests of both environments in two processes at once."""
    if rest:  # single tests while working: pytest's own arguments
        return _run("engine", "-m", "pytest", "blender_tests/engine", *rest)
    steps = [
        ("engine", "-m", "ruff", "format", "--check", "."),
        ("engine", "-m", "ruff", "check", "."),
        ("engine", "-m", "basedpyright", "--pythonpath", str(python_of("engine"))),
    ]
    for environment, *arguments in steps:
        print(f"--- {environment}: {' '.join(arguments)}", flush=True)
        code = _run(environment, *arguments)
        if code:
            return code
    tests = Path("blender_tests", "engine")
    found = [path for path in sorted((ROOT / tests).glob("[a-z]*")) if path.is_dir() or path.match("test_*.py")]
    others = [str(tests / path.name) for path in found if path.name not in FIRST_HALF]
    lanes = (
        (
            ("engine", "-m", "pytest", *(str(tests / name) for name in FIRST_HALF)),
            ("blender", "-m", "pytest", "blender_tests/addon"),
        ),
        (("engine", "-m", "pytest", *others), ("engine", "-m", "pytest", "blender_tests/page")),
    )
    with ThreadPoolExecutor(len(lanes)) as pool:
        return max(pool.map(run_lane, lanes))


def run_lane(steps: tuple[tuple[str, ...], ...]) -> int:
    """Run these one after the other, and print what each has printed when it is done."""
    codes = []
    for environment, *arguments in steps:
        command = [str(python_of(environment)), *arguments]
        done = subprocess.run(command, cwd=ROOT, env=_variables(), stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
        print(f"--- {environment}: {' '.join(arguments[:3])} ...\n{done.stdout.decode(errors='replace')}", flush=True)
        codes.append(done.returncode)
    return max(codes)


def run_matrix(options: argparse.Namespace, rest: list[str]) -> int:
    """Run the tests on other versions by nox, in environments that uv makes; without a network, say that none was run."""
    chosen = parse_matrix(rest)
    if chosen.clean:
        shutil.rmtree(ROOT / ".venv" / "matrix", ignore_errors=True)
        return 0
    try:
        setup("nox")
    except subprocess.CalledProcessError:
        print("matrix: skipped, nox could not be downloaded", flush=True)
        return int(chosen.strict)
    sessions = ["wheels"] if chosen.wheels else chosen.cells
    arguments = ["--list"] if chosen.list else ["--session", *sessions] if sessions else []
    arguments += [
        f"--{'' if chosen.strict else 'no-'}error-on-missing-interpreters"
    ]  # else nox asks whether it is in CI
    if chosen.out:
        chosen.out.parent.mkdir(parents=True, exist_ok=True)
        arguments += ["--report", str(chosen.out)]
    return _run("nox", "-m", "nox", *arguments, "--", *(name for name in ("quick", "strict") if getattr(chosen, name)))


def parse_matrix(rest: list[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python3 tools/dev.py matrix", description=run_matrix.__doc__)
    parser.add_argument("cells", nargs="*", metavar="CELL", help="which, as --list names them (default: all)")
    parser.add_argument("--quick", action="store_true", help="leave slow tests of the engine out")
    parser.add_argument("--strict", action="store_true", help="a skipped cell counts as a failed one")
    parser.add_argument("--out", type=Path, metavar="FILE", help="write what came of each cell as JSON")
    parser.add_argument("--wheels", action="store_true", help="only ask for which systems there are all packages")
    parser.add_argument("--list", action="store_true", help="only list the cells")
    parser.add_argument("--clean", action="store_true", help="only remove the environments")
    return parser.parse_args(rest)


def run_evaluate(options: argparse.Namespace, rest: list[str]) -> int:
    return _run("engine", "-m", "tools.evaluate", *rest)


def run_faults(options: argparse.Namespace, rest: list[str]) -> int:
    """Throw all faults; `rest` is pytest's, such as `-k kills`, and `--kills N` and `--seed N`."""
    return _run("engine", "-m", "pytest", "blender_tests/engine/faults", "-v", "--all-faults", *rest)


def run_fuzz(options: argparse.Namespace, rest: list[str]) -> int:
    """Change many files of every reader; `rest` is pytest's, such as `-k PLY`, and `--mutants N`."""
    shown = ("-v", "--hypothesis-show-statistics", "--capture=sys", "--basetemp=fuzz_out")
    mutants = ("-m", "pytest", "blender_tests/engine/readers", "--mutants=400", *shown, *rest)
    return _run("engine", *mutants, **ONE_THREAD)


def run_window(options: argparse.Namespace, rest: list[str]) -> int:
    """Build the extension, then use it in a real window."""
    return build(options, []) or _run("engine", "-m", "tools.window", *rest)


def build(options: argparse.Namespace, rest: list[str]) -> int:
    """Pack the extension by this Python alone; `--release` refuses while a published table is stale."""
    return subprocess.run([sys.executable, "-m", "tools.release", *rest], cwd=ROOT).returncode


def wheel(options: argparse.Namespace, rest: list[str]) -> int:
    """Build the engine's source archive, from it the wheel, and check what both say of themselves."""
    setup("wheel")
    with tempfile.TemporaryDirectory() as folder:
        code = _run("wheel", "-m", "build", "--no-isolation", "--outdir", folder, str(ROOT))
        built = sorted(Path(folder).iterdir())
        code = code or _run("wheel", "-m", "twine", "check", "--strict", *map(str, built))
        (ROOT / "dist").mkdir(exist_ok=True)
        for path in built if not code else ():
            print(shutil.copy(path, ROOT / "dist"))
    return code


def page(options: argparse.Namespace, rest: list[str]) -> int:
    """Bundle the viewer of web pages, with the licenses of what is in it, from packages in the versions of its lock file."""
    npm = shutil.which("npm")
    if npm is None or shutil.which("node") is None:
        sys.exit(
            "error: the viewer of web pages is built by Node and npm; on Debian or Ubuntu: apt-get install nodejs npm"
        )
    for command in (["ci"], ["run", "--silent", "build"]):
        code = subprocess.run([npm, *command], cwd=WEB).returncode
        if code:
            return code
    for path in sorted((WEB / "dist").iterdir()):
        print(f"{path}: {path.stat().st_size / 1000:.0f} kB")
    return 0


def docs(options: argparse.Namespace, rest: list[str]) -> int:
    """Build the documentation site of README.md, docs/*.md and the docstrings."""
    setup("docs")
    out = ROOT / "docs_out"
    code = _run("docs", "-m", "sphinx", "--fail-on-warning", "--fresh-env", "-c", "docs/site", ".", str(out))
    if not code:
        print(out / "index.html")
    return code


def lock(options: argparse.Namespace, rest: list[str]) -> int:
    """Lock the packages of the engine's environment for every system, in the versions of requirements/."""
    setup("lock")
    return _run("lock", "-m", "tools.lock_engine")


def _run(environment: str, *arguments: str, **variables: str) -> int:
    """Run one of the environments' Python at the root, with the engine's Python known to Blender."""
    return subprocess.run([str(python_of(environment)), *arguments], cwd=ROOT, env=_variables() | variables).returncode


def _variables() -> dict[str, str]:
    """The environment of all that is run: Blender's tests start the engine's Python."""
    return os.environ | {"KARF_ENGINE_PYTHON": str(python_of("engine"))}


if __name__ == "__main__":
    sys.exit(main())
