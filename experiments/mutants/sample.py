"""Which mutants are tried: a seeded sample, as many of each part, of cosmic-ray's operators."""

import random
import re
from pathlib import Path

from cosmic_ray.commands import init
from cosmic_ray.work_db import WorkDB, use_db
from cosmic_ray.work_item import WorkItem

PARTS = {
    "car": ("vehicle/bicycle", "vehicle/tyre", "vehicle/effects", "vehicle/plant", "vehicle/path_plant",
            "vehicle/double_track/motion", "vehicle/double_track/tires", "vehicle/double_track/parameters"),
    "belief": ("model/posterior", "model/bayesian_step", "model/features", "model/out_of_distribution",
               "monitoring/evidence"),
    "ocp": ("control/ocp", "control/stacked", "control/riccati", "control/tightening", "control/tracking",
            "control/interior_point"),
    "gathering": ("gathering/information", "gathering/control_information", "gathering/choice", "gathering/plan"),
    "apply": ("diagnosis/answers/apply", "exporting/vehicles", "exporting/logs", "vehicle/vehicle_file"),
    "import": ("logs/importing/units", "logs/importing/smoothing", "logs/importing/position", "logs/importing/clocks",
               "logs/importing/stretches", "logs/importing/formats/times", "logs/noise", "logs/clock_offset"),
    "metrics": ("simulation/metrics", "identification/whiteness", "model/quality", "identification/agreement"),
    "estimation": ("estimation/filter_state", "estimation/windows", "estimation/reduction", "estimation/regression",
                   "estimation/scores", "estimation/robust_fit", "diagnosis/shared/posterior"),
}  # fmt: skip
"""Modules of the package by part, in the order in which they are tried."""

OPERATORS = re.compile(
    r"core/(ReplaceBinaryOperator_(Add_Sub|Sub_Add|Mul_Div|Div_Mul|Pow_Mul|Mod_Mul)"
    r"|ReplaceComparisonOperator_(Lt_GtE|LtE_Gt|Gt_LtE|GtE_Lt|Eq_NotEq|NotEq_Eq|Lt_LtE|Gt_GtE|LtE_Lt|GtE_Gt)"
    r"|ReplaceUnaryOperator_(Delete_USub|Delete_Not)|NumberReplacer|ReplaceAndWithOr|ReplaceOrWithAnd"
    r"|ReplaceTrueWithFalse|ReplaceFalseWithTrue|ReplaceBreakWithContinue|ReplaceContinueWithBreak)"
)
"""Those whose mutants are faults that a person makes; `+` for `>>` is none."""


def sample(package: Path, session: Path, count: int, seed: int) -> None:
    """Writes cosmic-ray's session (a database) of `count` mutants of the package's modules, where there is none yet."""
    if session.exists():
        return
    candidates, chosen = session.with_suffix(".candidates"), session.with_suffix(".part")
    draw = random.Random(seed)
    with use_db(chosen, WorkDB.Mode.create) as work:
        work.clear()
        for modules in PARTS.values():
            with use_db(candidates, WorkDB.Mode.create) as every:
                init([package / f"{module}.py" for module in modules], every, {})
                items = sorted(filter(_wanted, every.work_items), key=_place)
            work.add_work_items(draw.sample(items, min(len(items), -(-count // len(PARTS)))))
    candidates.unlink()
    chosen.rename(session)


def part_of(module: str) -> str:
    """The part that a module of the package belongs to."""
    return next(part for part, modules in PARTS.items() if module in modules)


def _wanted(item: WorkItem) -> bool:
    return OPERATORS.fullmatch(item.mutations[0].operator_name) is not None


def _place(item: WorkItem) -> tuple[str, str, int]:
    mutation = item.mutations[0]
    return str(mutation.module_path), mutation.operator_name, mutation.occurrence
