"""Run the engine on another computer by ssh, in place of the engine's Python.

    python3 -m karf_engine.remote user@gpu --python /opt/karf/bin/python --map /mnt/film=/srv/film -- ARGUMENTS

runs Python there with the same arguments, as Blender passes them. Requests and events are files of the project in a
shared folder; standard input (cancel and queries) goes through ssh. Standard library only.
"""

from __future__ import annotations

import argparse
import shlex
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from .errors import KarfError
from .worker.path_map import PathMap
from .worker.protocol import EventReader, EventWriter

ENGINE = Path(__file__).resolve().parent
UNREACHABLE = 255  # ssh's exit code where it cannot connect


def main(arguments: Sequence[str] | None = None) -> int:
    """Run Python on another computer and return its exit code."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    end = given.index("--") if "--" in given else len(given)
    own, for_python = given[:end], given[end + 1 :]
    parser = argparse.ArgumentParser(
        prog="karf_engine.remote",
        usage="%(prog)s [user@]HOST --python PYTHON [--map HERE=THERE ...] -- ARGUMENTS",
        description="Run the engine on another computer by ssh.",
    )
    parser.add_argument("host", help="as ssh knows it")
    parser.add_argument("--python", required=True, help="there, with the engine installed")
    parser.add_argument("--map", action="append", default=[], help="a shared folder's path here and there")
    options = parser.parse_args(own)
    try:
        paths = PathMap.of(options.map)
        command, job = remote_command(for_python, options.map, paths)
    except KarfError as error:
        print(f"error: {error}", file=sys.stderr)
        return error.exit_code
    done = subprocess.run(["ssh", "-T", "-o", "BatchMode=yes", options.host, shlex.join([options.python, *command])])
    if done.returncode and job is not None:
        _explain(job, options.host, paths, done.returncode)
    return done.returncode


def remote_command(arguments: Sequence[str], texts: Sequence[str], paths: PathMap) -> tuple[list[str], Path | None]:
    """Return the arguments of the remote Python, and the local folder of the job that they run, if any.

    The engine's folder becomes the engine installed there, and paths in shared folders are mapped. `texts` are the shared
    folders for the remote engine, `paths` the same as a map. Raises BadRequest if the job is not in a shared folder.
    """
    command, job = [], None
    for number, argument in enumerate(arguments):
        if _is_engine(argument):
            command += ["-m", ENGINE.name]
        elif number > 1 and arguments[number - 1] == "run" and _is_engine(arguments[number - 2]):
            job = Path(argument)
            command += [paths.to_local(argument), *(part for text in texts for part in ("--map", text))]
        else:
            command.append(paths.local_path(argument) or argument)
    return command, job


def _is_engine(argument: str) -> bool:
    path = Path(argument)
    return path.name == ENGINE.name and path.is_absolute()


def _explain(job: Path, host: str, paths: PathMap, code: int) -> None:
    """Write an error event for a job without any events."""
    if any(True for _ in EventReader(job).poll()):
        return
    sentence = f"{host} did not run the job {paths.to_local(str(job))} (exit code {code}); its log tells more."
    hint = "Does that computer see the project there? Else share its folder, and name it in --map."
    if code == UNREACHABLE:
        sentence, hint = f"{host} cannot be reached by ssh.", f"Try in a terminal, without a password: ssh {host}"
    EventWriter(job)("error", code="data", sentence=sentence, hint=hint)


if __name__ == "__main__":
    sys.exit(main())
