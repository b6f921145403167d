"""All parts of the evaluation: what each measures, what it needs, and how long it takes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module

from .store import Store
from .table import Table

SEEDS = range(240, 260)  # of the drawn scenes that are reported: nothing is chosen on them; 0 to 7 are for work
OF_HEADS = SEEDS[:4]  # scenes on which heads are compared, beside the demo


@dataclass(frozen=True)
class Job:
    """A part of the evaluation, run in a process of its own.

    Attributes:
        minutes: processor minutes that it takes.
        work: `module.function` of this package; called with the store and `arguments`, it returns a table to publish, or
            anything else where it only prepares.
        needs: parts that have to be done before.
        result: what the store keeps of it, where it publishes no table.
    """

    minutes: float
    work: str
    arguments: tuple = ()
    needs: tuple[str, ...] = ()
    result: str = ""

    def run(self, store: Store) -> Table | None:
        """Do the work; modules are imported only now, so that those of other parts do not count as sources of this one."""
        module, _, name = self.work.rpartition(".")
        function: Callable = getattr(import_module(f"{__package__}.{module}"), name)
        found = function(store, *self.arguments)
        return found if isinstance(found, Table) else None


def scene_name(seed: int) -> str:
    """Return the name of a drawn scene."""
    return f"seed_{seed:03d}"


JOBS: dict[str, Job] = {
    "heads_on_nerf": Job(80, "heads.heads_on_nerf_table"),  # the longest stand first
    "real": Job(20, "real.real_table"),
    "demo": Job(4, "demo.Demo", result="demo"),
    "segmentation": Job(6, "segmentation.segmentation_table", needs=("demo",)),
    "outside": Job(1, "edits.outside_table", needs=("demo",)),
    "edits": Job(4, "edits.edits_table", needs=("demo",)),
    "consistency": Job(3, "consistency.consistency_table", needs=("demo",)),
    "ablations": Job(11, "ablations.ablations_table", needs=("demo",)),
    "differences": Job(6, "ablations.differences_table", needs=("demo",)),
    **{scene_name(seed): Job(7, "drawn.judge_scene", (seed,), result=f"{scene_name(seed)}/learned") for seed in SEEDS},
    "drawn": Job(0.2, "drawn.drawn_table", (SEEDS,), tuple(map(scene_name, SEEDS))),
    **{
        f"rivals_{seed}": Job(
            2, "rivals.measuring.measure_rivals", (seed,), (scene_name(seed),), f"{scene_name(seed)}/rivals"
        )
        for seed in SEEDS
    },
    "rivals": Job(0.2, "rivals.measuring.rivals_table", (SEEDS,), tuple(f"rivals_{seed}" for seed in SEEDS)),
    "heads": Job(20, "heads.heads_table", (OF_HEADS,), ("demo", *map(scene_name, OF_HEADS))),
    "kernels": Job(3, "speed.kernels_table"),
    "stages": Job(0.1, "speed.stages_table", needs=("demo",)),
    "swatch": Job(1, "speed.swatch_table"),
}
TABLES = tuple(name for name, job in JOBS.items() if not job.result)


def to_run(names: list[str], is_current: Callable[[str], bool]) -> list[str]:
    """Return which of these parts, and of those that they need, are not current, in an order in which they can run."""
    wanted = {name for name in names if not is_current(name)}
    for name in reversed(JOBS):  # what a part needs comes before it
        if name in wanted:
            wanted |= {need for need in JOBS[name].needs if not is_current(need)}
    return [name for name in JOBS if name in wanted]
