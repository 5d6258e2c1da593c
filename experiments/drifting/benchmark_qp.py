"""The solvers of the field on the quadratic programs of a drift: ours, OSQP, and those that CasADi's wheel brings.

    python -m experiments.drifting.benchmark_qp
    python -m experiments.drifting.benchmark_qp --horizons 25 --problems 500

The QPs are recorded while the learnt MPC plans along the figure-8, as `benchmark_mpc` places its problems. Each is
solved by every solver in turn, so that what else the machine does falls on all. Ours and OSQP are called as the
controller calls them. The peers get the same program with its variables in the order of the stages (`StagedProgram`);
their matrices are filled beforehand, so that their time is CasADi's call and the solver. All start cold but ours and
OSQP, which begin at the last solution, as in the controller. CPU times of one thread. `error`: the largest difference
of a scaled variable from our solution at a tolerance of 1e-9.
"""

import dataclasses
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from diagrams.command import run_command
from drift_drake.common.arrays import Array
from drift_drake.common.errors import InvalidOptionError, MissingExtraError
from drift_drake.common.run_folder import machine
from drift_drake.common.threads import one_blas_thread
from drift_drake.drive.learnt.checkpoint import load_model
from drift_drake.drive.learnt.quality import step_model
from drift_drake.drive.mpc.ocp import OcpData, OcpWeights, OptimalControlProblem
from drift_drake.drive.mpc.plan import DT
from drift_drake.drive.mpc.sqp import LineSearchSqp, SqpOptions
from drift_drake.drive.qp.qp import QpOptions, QpSolution, QpWorkspace
from drift_drake.drive.qp.stages import Stages
from drift_drake.drive.reference.trajectory import figure_8
from experiments.drifting.benchmark_mpc import ADVANCE, SPREAD, START, statistics
from experiments.drifting.casadi_ocp import installed
from experiments.drifting.timed_parts import cpu
from experiments.made import RunConfig, begun, tabulated, write_results

HPIPM_TOLERANCES = ("res_g_max", "res_b_max", "res_d_max", "res_m_max")
PEERS: dict[str, dict[str, Any]] = {
    "hpipm": {"hpipm": {"iter_max": 40, **dict.fromkeys(HPIPM_TOLERANCES, 1e-6)}, "inf": 1e9},
    "piqp": {},
    "proxqp": {},
}
SAME = 1e-3  # error in scaled variables up to which a peer has found the solution


@dataclasses.dataclass(frozen=True)
class QpBenchmarkConfig(RunConfig):
    """Size of the benchmark."""

    horizons: tuple[int, ...] = (10, 25, 45)
    problems: int = 200
    peers: tuple[str, ...] = tuple(PEERS)
    """Solvers of CasADi's wheel."""
    seed: int = 0


class Recorded(NamedTuple):
    """One QP as the controller's solver gets it."""

    stages: Stages
    f: Array  # Jacobians of the dynamics [N, n, n+4]
    target: Array  # [N, n]
    z: Array  # where it starts from
    y: Array


class Recorder(QpWorkspace):
    """A workspace that keeps what it is given."""

    def __init__(self, workspace: QpWorkspace) -> None:
        self._workspace = workspace
        self.found: list[Recorded] = []

    def solve(self, stages: Stages, f: Array, target: Array, z: Array, y: Array) -> QpSolution:
        bounds = stages.bounds._replace(**{name: np.array(value) for name, value in stages.bounds._asdict().items()})
        kept = stages._replace(
            bounds=bounds,
            hessian=np.array(stages.hessian),
            gradient=np.array(stages.gradient),
            given=np.array(stages.given),
        )
        self.found.append(Recorded(kept, *map(np.array, (f, target, z, y))))
        return self._workspace.solve(stages, f, target, z, y)


def recorded(horizon: int, problems: int, seed: int) -> list[Recorded]:
    """The QPs of so many plans along the figure-8."""
    learnt = load_model()
    reference, rng = figure_8(learnt.vehicle), np.random.default_rng(seed)
    model = step_model(learnt, learnt.prior())
    problem = OptimalControlProblem(model, learnt.vehicle, horizon, OcpWeights(delta=60.0))
    sqp = LineSearchSqp(problem, SqpOptions.real_time())
    recorder = Recorder(sqp.workspace)
    sqp.workspace = recorder
    last: tuple[Array, Array | None] = np.empty(0), None
    for number in range(problems):
        s = START + ADVANCE * number
        window, command = reference.horizon(s, DT, horizon), reference.input(s)
        start = np.append(reference.state(s) + rng.normal(size=6) * SPREAD, command)
        data = OcpData(start, command, window.x_ref, window.curvature, window.e_min, window.e_max)
        problem.set(data)
        if number == 0:
            last = problem.first_guess(data), None
        result = sqp.solve(*last)
        last = result.z, result.y
    return recorder.found


class StagedProgram(NamedTuple):
    """min 1/2 w'Hw + g'w, low <= A w <= high, by stages: w = (x_k, u_k, slack_k | u_{k+1}, slack_{k+1}), k = 0..N.

    Left of the bar is a stage's state, right of it its input, which the last stage lacks; slack_0 is zero.
    """

    hessian: Array
    gradient: Array
    matrix: Array  # the dynamics of a stage, then its bounds
    low: Array
    high: Array
    sizes: dict[str, Any]  # N, nx, nu, ng, as HPIPM's interface asks for them


def staged(found: Recorded) -> StagedProgram:
    """A recorded QP by stages, dense."""
    stages, bounds = found.stages, found.stages.bounds
    count, n = len(stages.columns), stages.state_size
    state, width = n + 3, n + 6
    size = count * width + state
    hessian, gradient = np.zeros((size, size)), np.zeros(size)
    gx, gu, gslack = stages.split(stages.gradient)
    rows, low, high, counts = [], [], [], []
    for k in range(count + 1):
        at = k * width
        own = slice(at, at + state)
        gradient[own] = np.concatenate([gx[k], gu[k], gslack[k - 1 : k] if k else [0.0]])
        if k < count:
            place = at + np.array([*range(n + 2), state, state + 1])
            hessian[np.ix_(place, place)] = stages.hessian[k]
            dynamics = np.zeros((state, size))
            dynamics[:n, place] = found.f[k]
            dynamics[n:, at + state : at + width] = np.eye(3)
            dynamics[:, at + width : at + width + state] = -np.eye(state)
            rows.append(dynamics)
            low += [*found.target[k], 0.0, 0.0, 0.0]
            high += low[-state:]
        here = slice(bounds.first[k - 1], bounds.first[k])
        values = bounds.values[here] if k else np.eye(state)
        limits = (bounds.low[here], bounds.high[here]) if k else 2 * (np.append(stages.given, 0.0),)
        rows.append(np.zeros((len(values), size)))
        rows[-1][:, own] = values
        low += [*limits[0]]
        high += [*limits[1]]
        counts.append(len(values))
    sizes = {"N": count, "nx": [state] * (count + 1), "nu": [*[3] * count, 0], "ng": counts}
    return StagedProgram(hessian, gradient, np.concatenate(rows), np.array(low), np.array(high), sizes)


def decision(stages: Stages, w: Array) -> Array:
    """The decision vector of a staged program's solution."""
    count, n = len(stages.columns), stages.state_size
    table = np.append(w, np.zeros(3)).reshape(count + 1, n + 6)
    return np.concatenate([table[:, :n].ravel(), table[:, n : n + 2].ravel(), table[1:, n + 2]])


class Peer:
    """A QP solver of CasADi for programs of one pattern."""

    def __init__(self, name: str, program: StagedProgram, pattern: Array) -> None:
        """Args: pattern: entries of the matrix that are not zero in any of the programs."""
        import casadi as ca

        self._dm, options = ca.DM, dict(PEERS[name])
        if name == "hpipm":
            options |= program.sizes
        self._shapes = {
            name: ca.sparsify(ca.DM(there.astype(float))).sparsity()
            for name, there in (("h", program.hessian != 0.0), ("a", pattern))
        }
        self._places = {name: tuple(map(np.array, shape.get_triplet())) for name, shape in self._shapes.items()}
        self._solver = ca.conic("peer", name, self._shapes, {"error_on_fail": False, **options})

    def given(self, program: StagedProgram) -> dict[str, Any]:
        """A program as the solver takes it."""
        numbers = {"h": program.hessian, "a": program.matrix}
        matrices = {name: self._dm(self._shapes[name], numbers[name][place]) for name, place in self._places.items()}
        return {**matrices, "g": program.gradient, "lba": program.low, "uba": program.high}

    def solve(self, given: dict[str, Any]) -> Array:
        """The solution, in the stages' order."""
        return np.asarray(self._solver(**given)["x"]).ravel()


def compare(horizon: int, config: QpBenchmarkConfig) -> dict[str, dict[str, Any]]:
    """Times [ms], share of QPs solved to `SAME` and the largest error of each solver, for one horizon."""
    found = recorded(horizon, config.problems, config.seed)
    exact = QpWorkspace(found[0].stages, QpOptions())
    calls: dict[str, Callable[[Recorded, StagedProgram], tuple[float, Array]]] = {
        "ours": as_controller(QpWorkspace(found[0].stages, SqpOptions.real_time().qp)),
        "osqp": as_controller(QpWorkspace(found[0].stages, SqpOptions.real_time(method="osqp").qp)),
    }
    programs = [staged(one) for one in found]
    pattern = np.any([program.matrix != 0.0 for program in programs], axis=0)
    calls |= {name: as_peer(Peer(name, programs[0], pattern)) for name in config.peers}
    times: dict[str, list[float]] = {name: [] for name in calls}
    errors: dict[str, list[float]] = {name: [] for name in calls}
    for one, program in zip(found, programs, strict=True):
        right = exact.solve(*one).z
        for name, call in calls.items():
            seconds, z = call(one, program)
            times[name].append(seconds)
            errors[name].append(float(np.abs(z - right).max()))
    return {
        name: {"ms": statistics(times[name][1:]), "solved": float(np.mean(np.array(errors[name]) <= SAME)),
               "error": float(np.median(errors[name]))}
        for name in calls
    }  # fmt: skip


def as_controller(workspace: QpWorkspace) -> Callable[[Recorded, StagedProgram], tuple[float, Array]]:
    """(CPU time [s], decision vector) of a solver as the controller calls it."""

    def call(one: Recorded, _program: StagedProgram) -> tuple[float, Array]:
        seconds, solution = cpu(lambda: workspace.solve(*one))
        return seconds, solution.z

    return call


def as_peer(peer: Peer) -> Callable[[Recorded, StagedProgram], tuple[float, Array]]:
    """(CPU time [s], decision vector) of a solver of CasADi."""

    def call(one: Recorded, program: StagedProgram) -> tuple[float, Array]:
        given = peer.given(program)
        seconds, w = cpu(lambda: peer.solve(given))
        return seconds, decision(one.stages, w)

    return call


def table(numbers: dict[str, Any]) -> str:
    """The results as Markdown."""
    rows = []
    for horizon, found in numbers["horizons"].items():
        for name, one in found.items():
            ms = " / ".join(f"{value:.2g}" for value in one["ms"].values())
            ratio = one["ms"]["median"] / found["ours"]["ms"]["median"]
            rows.append((horizon, name, ms, f"{ratio:.2f}", f"{one['solved']:.1%}", f"{one['error']:.1e}"))
    said = f"{numbers['machine']}; CPU time [ms]: median / 99.9 % / worst; solved: error at most {SAME:g}"
    return "\n".join([said, "", *tabulated(("N", "solver", "time", "over ours", "solved", "median error"), rows)])


@one_blas_thread()
def run(config: QpBenchmarkConfig) -> dict[str, Any]:
    """The comparison for each horizon."""
    return {"machine": machine(), "horizons": {str(horizon): compare(horizon, config) for horizon in config.horizons}}


def main(config: QpBenchmarkConfig) -> None:
    """Runs, prints and stores the benchmark.

    Raises:
        InvalidOptionError: too few problems to time, or a solver that is not there;
        MissingExtraError: CasADi is not installed.
    """
    if config.problems < 2:
        raise InvalidOptionError(f"--problems is {config.problems}; give 2 or more: the first is not timed")
    for name in set(config.peers) - set(PEERS):
        raise InvalidOptionError(f"--peers {name}: there are {', '.join(PEERS)}")
    if config.peers and not installed():
        raise MissingExtraError("the peers' solvers", "casadi", "peers")
    numbers = run(config)
    write_results(begun("benchmark_qp", config), config, numbers, table(numbers))


if __name__ == "__main__":
    run_command(main, QpBenchmarkConfig, __doc__)
