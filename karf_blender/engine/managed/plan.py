"""What an installation will do, before it does it: how much, from where, where to, by which commands. No bpy."""

import os
import shutil
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from ...engine_api import BadRequest, DataError
from . import environments, home, lists, machine, recipes, shells, sources, starters, wheelhouse
from .home import Home
from .machine import Machine
from .recipes import Recipe, Wheel
from .sources import Source
from .starters import Starter

# bytes on disk for each that is fetched, with compiled Python files; measured for cpu and cuda on Linux
UNPACKED = {"cpu": 4.0, "cuda": 1.9, "rocm": 3.5, "mps": 3.5}
ESTIMATES = {  # bytes of a build of torch that no recipe has, by system and build
    ("linux", "cpu"): 200_000_000,
    ("linux", "rocm"): 5_000_000_000,
    ("windows", "cuda"): 2_900_000_000,
}
LONGEST_PATH = 259  # letters of a path on Windows, unless it is set up otherwise
LONGEST_INSIDE = 153  # letters of the longest path below the folder that Python opens; uv itself knows no limit


@dataclass(frozen=True)
class Choices:
    """What the user wants.

    folder: where to. build: one of `machine.BUILDS`. extras: of `recipes.EXTRAS`. wheels: a folder of wheels in place
    of the network. starter: the path of a Python, or of uv, that makes the environment; empty: the first found.
    """

    folder: Path
    build: str = "auto"
    extras: tuple[str, ...] = ()
    wheels: Path | None = None
    starter: str = ""


@dataclass(frozen=True)
class Step:
    """One command.

    title: what it does, for people. source: where it fetches from, for people. wheels: the files that it puts in place.
    estimate: bytes of what it fetches besides them. is_needed: whether all fails where it fails.
    """

    title: str
    command: tuple[str, ...]
    source: str = ""
    wheels: tuple[Wheel, ...] = ()
    estimate: int = 0
    is_needed: bool = True

    @property
    def bytes(self) -> int:
        """How much it fetches or unpacks."""
        return sum(wheel.size for wheel in self.wheels) + self.estimate


@dataclass(frozen=True)
class Plan:
    """All that an installation needs to know.

    build: `cpu`, `cuda`, `rocm` or `mps`. backend: uv's option for that build; empty: the recipe has it.
    wheels: the files, with sizes and hashes. unchecked: what else comes, without a hash of ours. estimate: bytes of it.
    free_bytes: what the folder's disk has. is_begun: whether some of it is there already. counting: the environment
    that counts until this one is ready. is_copied: whether this one begins as its copy. home: the new environment.
    """

    choices: Choices
    machine: Machine
    starter: Starter
    source: Source
    recipe: Recipe
    build: str
    backend: str
    wheels: tuple[Wheel, ...]
    unchecked: str
    estimate: int
    free_bytes: int
    is_begun: bool
    counting: Home | None
    is_copied: bool
    home: Home

    @property
    def torch_source(self) -> str:
        """Where torch comes from: where the packages do, but for builds that uv's backend gets."""
        return "torch's own index, which uv knows" if self.backend and not self.choices.wheels else self.source.sentence

    @property
    def tools(self) -> tuple[Wheel, ...]:
        """uv itself, where it is not on this computer."""
        return () if self.starter.uv else self.recipe.parts["uv"]

    @property
    def download_bytes(self) -> int:
        """How much comes from the source."""
        return sum(wheel.size for wheel in self.wheels + self.tools) + self.estimate

    @property
    def disk_bytes(self) -> int:
        """How much the environment will take, estimated."""
        return round(self.download_bytes * UNPACKED[self.build])

    @property
    def sentences(self) -> tuple[str, ...]:
        """The plan, for people."""
        count, size = len(self.wheels + self.tools), size_text(self.download_bytes)
        about = "about " if self.estimate else ""
        begun = " What is there already and whole is not fetched again." if self.is_begun else ""
        lines = [
            f"{self.machine.device_sentence} Build of torch: {self.build}.",
            f"{count} checked files{f' and {self.unchecked}' if self.unchecked else ''}, {about}{size}.{begun}",
            f"From {' and '.join(dict.fromkeys((self.source.sentence, self.torch_source)))}.",
            f"To {self.choices.folder}, about {size_text(self.disk_bytes)}; {size_text(self.free_bytes)} are free.",
            f"The environment is {self.starter.sentence}. Blender's own Python stays as it is.",
        ]
        return (*lines, *self.warnings)

    @property
    def warnings(self) -> tuple[str, ...]:
        """What may go wrong, for people."""
        found = []
        if self.unchecked:
            found.append(f"KaRF has no hash of {self.unchecked}: it is checked by its version only.")
        if self.machine.is_windows and len(str(self.choices.folder)) + LONGEST_INSIDE > LONGEST_PATH:
            found.append(
                "Paths below this folder get longer than Windows allows by default: choose a folder such as "
                "C:\\karf, or switch long paths on in Windows."
            )
        return tuple(found)

    @property
    def lists(self) -> dict[str, tuple[str, ...]]:
        """Name -> parts of the recipe, of the lists that pip and uv are given."""
        packages = self.recipe.parts_of(self.backend, self.choices.extras)
        return {"packages": packages} | ({"uv": ("uv",)} if self.tools else {})

    @property
    def uv(self) -> str:
        """The uv that puts packages in place."""
        return self.starter.uv or str(self.home.program("uv"))

    def steps(self) -> tuple[Step, ...]:
        """The commands of a first installation, in their order."""
        known = [
            self.write_lists(),
            self.make_environment(),
            *([self.fetch_uv()] if self.tools else []),
            self.put_packages(),
        ]
        return (*known, *([self.put_torch()] if self.unchecked else []))

    def write_lists(self) -> Step:
        """Write the lists of files. The installation does it itself."""
        starter = self.starter
        uv_run = [starter.uv, "run", "--no-project", "--python", starter.version]
        python = [starter.python, "-I", "-B"] if starter.python else uv_run
        named = [f"{name}={','.join(parts)}" for name, parts in self.lists.items()]
        command = [*python, lists.__file__, str(self.choices.folder), self.recipe.platform, self.recipe.python, *named]
        return Step("Writing the lists of files", tuple(command))

    def copy_environment(self) -> Step:
        """Remove environments that do not count, and copy the one that does where the new one begins as it is."""
        return self._environments("Copying what is there", self.counting, *([self.home.name] if self.is_copied else []))

    def remove_former(self) -> Step:
        """Remove all environments but the new one."""
        return self._environments("Removing what was there before", self.home)

    def _environments(self, title: str, counting: Home, *copies: str) -> Step:
        python = [str(counting.python), "-I", "-B", "-X", "utf8", environments.__file__]
        return Step(title, (*python, str(self.choices.folder), counting.name, *copies), is_needed=False)

    def make_environment(self) -> Step:
        """Make the environment, in place of one that may be there."""
        folder, starter = str(self.home.environment), self.starter
        if starter.uv:
            command = [starter.uv, "venv", "--clear", "--python", starter.python or starter.version, folder]
        else:
            command = [starter.python, "-I", "-m", "venv", "--clear", folder]
        return Step("Making the environment", tuple(command))

    def fetch_uv(self) -> Step:
        """Put uv into the environment, by the pip that it was made with."""
        pip = [str(self.home.python), "-I", "-m", "pip", "install", "--require-hashes", "--no-deps"]
        pip += [
            "--only-binary",
            ":all:",
            "--disable-pip-version-check",
            "--no-input",
            "--progress-bar",
            "off",
            "--retries",
            "2",
        ]
        command = [*pip, *self._offline(), "--requirement", str(self.home.requirements("uv"))]
        return Step("Fetching uv", tuple(command), self.source.sentence, self.tools)

    def put_packages(self, anew: tuple[str, ...] = ()) -> Step:
        """Put the checked files in place; those of the packages `anew` also where they seem to be there."""
        command = [*self._uv_install(anew), "--no-deps", "--require-hashes"]
        command += ["--requirement", str(self.home.requirements("packages"))]
        return Step("Installing packages", tuple(command), self.source.sentence, self.wheels)

    def put_torch(self, anew: tuple[str, ...] = ()) -> Step:
        """Put the build of torch in place that the recipe does not have."""
        backend = [] if self.choices.wheels else ["--torch-backend", self.backend]
        command = (*self._uv_install(anew), *backend, f"torch=={self.recipe.torch_version}")
        return Step("Installing torch", command, self.torch_source, estimate=self.estimate)

    def _uv_install(self, anew: tuple[str, ...]) -> list[str]:
        command = [self.uv, "pip", "install", "--python", str(self.home.python), "--cache-dir", str(self.home.cache)]
        # the engine's jobs write no compiled files: without them each would read all sources anew
        command += ["--only-binary", ":all:", "--compile-bytecode"]
        command += [part for name in anew for part in ("--reinstall-package", name)]
        return [*command, *self._offline()]

    def _offline(self) -> list[str]:
        return ["--no-index", "--find-links", str(self.choices.wheels)] if self.choices.wheels else []

    def commands(self, shell: str = "") -> str:
        """The same by hand, for `posix`, `powershell` or `cmd`; default: this system's usual one."""
        shell = shell or ("powershell" if self.machine.is_windows else "posix")
        return "\n".join(shells.line(step.command, shell) for step in self.steps())


def make(
    choices: Choices,
    own_python: str,
    is_online: bool,
    variables: Mapping[str, str] = os.environ,
    here: Machine | None = None,
) -> Plan:
    """Find out what an installation would do. Takes a second; changes nothing.

    Args:
        choices: What the user wants.
        own_python: Blender's own Python.
        is_online: Whether Blender may use the network (`bpy.app.online_access`).
        variables: The process's environment.
        here: The computer; default: this one.

    Raises:
        KarfError: It cannot be done: no network allowed, no starter, no such build, wheels missing, no space.
    """
    here = here or machine.look()
    if not choices.folder.is_absolute():
        raise BadRequest(f"The folder {choices.folder} is not given by its whole path.", "Choose it anew.")
    home.check_free(choices.folder)
    if not (is_online or choices.wheels):
        raise BadRequest(
            "Blender may not use the network.",
            "Switch on Preferences > System > Network > Allow Online Access, or choose a folder of wheels.",
        )
    build = machine.build_for(choices.build, here)
    wanted = recipes.pythons(here.platform) or (recipes.find(here.platform, ""),)
    starter = starters.find(choices.starter, own_python, wanted, variables)
    recipe = recipes.find(here.platform, starter.version)
    backend = machine.backend_of(build, here)
    if choices.wheels is not None:
        build, backend = wheelhouse.build_in(choices.wheels, recipe, choices.build, build, backend)
    wheels = recipe.wheels(backend, choices.extras)
    unchecked = f"torch {recipe.torch_version} for {build}" if backend else ""
    estimate = ESTIMATES[(here.platform.partition("-")[0], build)] if backend else 0
    source = sources.find(variables, choices.wheels)
    free = _free_bytes(choices.folder)
    is_begun = Home(choices.folder).mark.is_file()
    counting, was = home.counting(choices.folder), home.status(choices.folder)
    is_copied = was.is_usable and (was.build, was.python) == (build, recipe.python)
    new = Home(choices.folder, environments.unused(choices.folder) if counting else environments.FIRST)
    plan = Plan(
        *(choices, here, starter, source, recipe, build, backend, wheels, unchecked, estimate, free, is_begun),
        *(counting if was.is_usable else None, is_copied, new),
    )
    if choices.wheels is not None:
        wheelhouse.check(choices.wheels, plan.wheels + plan.tools)
    _check_space(plan)
    return plan


def _free_bytes(folder: Path) -> int:
    """What the disk has that a folder is or will be on."""
    return shutil.disk_usage(next(path for path in (folder, *folder.parents) if path.is_dir())).free


def _check_space(plan: Plan) -> None:
    needed = plan.disk_bytes
    if plan.free_bytes < needed:  # then it is worth to count what is there already
        kept = (plan.counting if plan.is_copied else plan.home).environment, plan.home.cache
        needed -= sum(max(home.measure(folder), default=0) for folder in kept)
    if plan.free_bytes < needed:
        raise DataError(
            f"The disk of {plan.choices.folder} has {size_text(plan.free_bytes)} free; the engine needs about "
            f"{size_text(needed)}.",
            "Free some space, or choose a folder on another disk.",
        )


def size_text(count: int) -> str:
    """Bytes for people.

    Examples:
        >>> size_text(2_840_660_000), size_text(45_571)
        ('2.8 GB', '0.0 MB')
    """
    return f"{count / 1e9:.1f} GB" if count >= 1e9 else f"{count / 1e6:.{0 if count >= 1e7 else 1}f} MB"
