"""An FMU 2.0 or 3.0 (co-simulation or model exchange) as a simulator, by fmpy."""

from collections.abc import Mapping
from contextlib import chdir
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from drift_drake.car.foreign.rollouts import SimulatorError
from drift_drake.common.arrays import Array
from drift_drake.common.errors import one_line

TOLERANCE = 1e-6  # relative, of the solver of a model for exchange


@cache  # once in a process: each call would wrap the solver of the one before
def _follow_inputs() -> None:
    """Has FMPy's solver ask for the inputs at each moment: it applies them where a step has ended, often late."""
    from fmpy import sundials

    class Following(sundials.CVodeSolver):  # type: ignore[misc] # without types
        def f(self, t: float, y: Any, ydot: Any, user_data: Any) -> int:
            self.input.apply(t)
            return int(super().f(t, y, ydot, user_data))

    sundials.CVodeSolver = Following


class Fmu:
    """One instance, reset for each roll-out. Names are those of its model description."""

    def __init__(self, path: str) -> None:
        try:
            import fmpy
        except ImportError:
            raise SimulatorError(f'{path}: fmpy is missing; install it with pip install "drift_drake[fmu]"') from None
        self._fmpy, self._path = fmpy, path
        if not Path(path).is_file():
            raise SimulatorError(f"{path}: there is no such FMU; correct fmu:")
        try:
            self._description = fmpy.read_model_description(path)
            platforms = fmpy.supported_platforms(path)
        except Exception as error:  # of many classes: zip, XML, schema
            raise SimulatorError(f"{path}: is no FMU 2.0 or 3.0 that can be read ({one_line(error)})") from None
        if fmpy.platform not in platforms and fmpy.platform_tuple not in platforms:
            raise SimulatorError(
                f"{path}: is built for {', '.join(platforms) or 'no platform'}, not for {fmpy.platform}; export it for "
                "this platform"
            )
        self._kind = "CoSimulation" if self._description.coSimulation is not None else "ModelExchange"
        if self._kind == "ModelExchange":
            _follow_inputs()
        self._names = {variable.name for variable in self._description.modelVariables}
        self._folder = TemporaryDirectory(prefix="fmu_")  # removed with this object
        fmpy.extract(path, self._folder.name)
        self._instance = self._instantiated()

    def roll(self, start: Mapping[str, Any], held: Mapping[str, Array], inputs: Mapping[str, Array], dt: float,  # noqa: ARG002
             outputs: tuple[str, ...], parameters: Mapping[str, float]) -> Mapping[str, Any]:  # fmt: skip
        for names, what in (
            (start, "start value"), (inputs, "input"), (outputs, "output"), (parameters, "parameter"),
        ):  # fmt: skip
            self._check(names, what)
        rows = len(next(iter(inputs.values())))
        table = np.zeros(rows, dtype=[("time", float), *((name, float) for name in inputs)])
        # A co-simulation holds an input over a step: it is that of the step's middle.
        table["time"] = dt * (np.arange(rows) - (0.5 if self._kind == "CoSimulation" else 0.0))
        for name, values in inputs.items():
            table[name] = values
        given = {name: float(value) for name, value in start.items()} | dict(parameters)
        try:
            found = self._fmpy.simulate_fmu(
                self._folder.name, validate=False, start_time=0.0, stop_time=dt * (rows - 1), output_interval=dt,
                step_size=dt, relative_tolerance=TOLERANCE, start_values=given, input=table, output=list(outputs),
                fmi_type=self._kind, model_description=self._description, fmu_instance=self._instance,
                set_stop_time=False,
            )  # fmt: skip
        finally:
            self._reset()
        out = {}
        for name in outputs:
            values = np.asarray(found[name], dtype=float)
            out[name] = values[:rows] if len(values) >= rows else np.append(values, np.full(rows - len(values), np.nan))
        return out

    def _instantiated(self) -> Any:
        from fmpy.simulation import instantiate_fmu

        try:
            with chdir("."):  # FMPy leaves the process in a folder of the FMU where it cannot load that
                return instantiate_fmu(self._folder.name, self._description, fmi_type=self._kind)
        except Exception as error:  # of many classes: a library that is lacking, a licence, a refusal of its own
            raise SimulatorError(
                f"{self._path}: cannot be loaded ({one_line(error)}); try it with fmpy simulate, and export it anew"
            ) from None

    def _reset(self) -> None:
        """To where it was made; some exporters have no reset."""
        try:
            self._instance.reset()
        except Exception:  # of several classes
            self._instance.freeInstance()
            self._instance = self._instantiated()

    def _check(self, names: Any, what: str) -> None:
        for name in names:
            if name not in self._names:
                raise SimulatorError(
                    f"{self._path}: the FMU has no variable {name}, which the file names as {what}; correct it"
                )
