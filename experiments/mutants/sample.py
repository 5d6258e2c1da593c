"""Which mutants are tried: a seeded sample, as many of each part, of cosmic-ray's operators."""

import random
import re
from pathlib import Path

from cosmic_ray.commands import init
from cosmic_ray.work_db import WorkDB, use_db
from cosmic_ray.work_item import WorkItem

PARTS = {
    "car": (
        "car/single_track/motion",
        "car/tyre",
        "car/effects/magnitudes",
        "car/single_track/plant",
        "car/path_plant",
        "car/double_track/motion",
        "car/double_track/tyres",
        "car/double_track/parameters",
    ),
    "belief": (
        "drive/learnt/posterior",
        "drive/learnt/bayesian_step",
        "drive/learnt/features",
        "gap/monitoring/evidence",
    ),
    "ocp": (
        "drive/mpc/ocp",
        "drive/qp/stacked",
        "drive/qp/riccati",
        "drive/mpc/tightening",
        "drive/mpc/tracking",
        "drive/qp/interior_point",
    ),
    "gathering": (
        "drive/gathering/information",
        "gap/choose/choice",
        "drive/gathering/plan",
    ),
    "apply": ("gap/diagnosis/answers/apply", "view/exporting/vehicles", "view/exporting/logs", "car/vehicle_file"),
    "import": (
        "gap/logs/wording/conversion",
        "gap/logs/importing/smoothing",
        "gap/logs/importing/position",
        "gap/logs/importing/clocks",
        "gap/logs/importing/stretches",
        "gap/logs/importing/formats/times",
        "gap/logs/noise",
        "gap/logs/clock_offset",
    ),
    "metrics": (
        "drive/loop/metrics",
        "gap/identification/estimate",
        "drive/learnt/quality",
        "gap/identification/agreement",
    ),
    "estimation": (
        "gap/estimation/filter_state",
        "gap/estimation/windows",
        "gap/estimation/reduction",
        "gap/estimation/regression",
        "gap/estimation/scores",
        "gap/estimation/robust_fit",
        "gap/evidence/posterior",
    ),
}
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
