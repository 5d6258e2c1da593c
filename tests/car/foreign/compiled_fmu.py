"""Builds compiled_car.c as an FMU, with the variables of examples/simulators/fmu_car.yaml."""

import shutil
import subprocess
import zipfile
from pathlib import Path

SOURCE = Path(__file__).with_name("compiled_car.c")
COMPILER = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
PARAMETERS = {"m": 1450.0, "J": 2200.0, "lf": 1.2, "lr": 1.3, "mu": 1.0, "cf": 1.2e5, "cr": 1.5e5, "jw": 12.0,
              "radius": 0.32, "vx0": 12.0, "vy0": 0.0, "r0": 0.0, "w0": 37.5}  # fmt: skip
INPUTS, STATES = ("steer", "torque", "fx", "fy", "mz"), ("vx", "vy", "r", "w", "psi")
KINDS = {"2.0": ("ModelExchange",), "3.0": ("CoSimulation", "ModelExchange")}


def variables(three: bool, states: bool) -> str:
    """The XML of all variables; three: of FMI 3.0; states: with their derivatives."""
    lines = list[str]()

    def add(name: str, causality: str, variability: str, start: float | None = None, of: int | None = None) -> None:
        number, begin = len(lines), "" if start is None else f' start="{start}"'
        about = f'name="{name}" valueReference="{number}" causality="{causality}" variability="{variability}"'
        if three:
            derivative = "" if of is None else f' derivative="{of}"'
            lines.append(f"<Float64 {about}{derivative}{begin}/>")
        else:
            derivative = "" if of is None else f' derivative="{of + 1}"'
            lines.append(f"<ScalarVariable {about}><Real{derivative}{begin}/></ScalarVariable>")

    for name, value in PARAMETERS.items():
        add(name, "parameter", "tunable", value)
    for name in INPUTS:
        add(name, "input", "continuous", 0.0)
    first = len(lines)
    for name in STATES:
        add(name, "output", "continuous")
    for place, name in enumerate(STATES if states else ()):
        add(f"der({name})", "local", "continuous", of=first + place)
    if three:
        lines.append(f'<Float64 name="time" valueReference="{len(lines)}" causality="independent"/>')
    return "".join(lines)


def structure(three: bool, states: bool) -> str:
    """The XML of outputs and derivatives, by value reference or, in FMI 2.0, by index from 1."""
    first, count = len(PARAMETERS) + len(INPUTS), len(STATES)
    outputs, derivatives = range(first, first + count), range(first + count, first + 2 * count) if states else ()
    if three:
        return "".join(
            f'<{kind} valueReference="{i}"/>'
            for kind, places in (("Output", outputs), ("ContinuousStateDerivative", derivatives)) for i in places
        )  # fmt: skip
    found = ""
    for kind, places in (("Outputs", outputs), ("Derivatives", derivatives)):
        unknown = "".join(f'<Unknown index="{i + 1}"/>' for i in places)
        found += f"<{kind}>{unknown}</{kind}>" if places else ""
    return found


def further_functions(version: str) -> str:
    """C of all functions that FMPy looks for when it loads an FMU; those of compiled_car.c come before these."""
    from fmpy.fmi2 import FMU2Model
    from fmpy.fmi3 import FMU3Model, FMU3Slave

    prefix = f"fmi{version[0]}"
    names = {name for kind in (FMU2Model, FMU3Model, FMU3Slave) for name in dir(kind) if name.startswith(prefix)}
    return "".join(f"__attribute__((weak)) int {name}(void) {{ return 3; }}\n" for name in sorted(names))


def build(folder: Path, version: str, kind: str, *options: str) -> Path:
    """The FMU (.fmu) of a version and a kind of `KINDS`, in a folder; options: of the compiler."""
    import fmpy

    three, states = version == "3.0", kind == "ModelExchange"
    token = 'instantiationToken="car"' if three else 'guid="car" numberOfEventIndicators="0"'
    xml = (
        f'<?xml version="1.0" encoding="UTF-8"?>\n<fmiModelDescription fmiVersion="{version}" modelName="car" '
        f'{token}><{kind} modelIdentifier="car"/>'
        f"<ModelVariables>{variables(three, states)}</ModelVariables>"
        f"<ModelStructure>{structure(three, states)}</ModelStructure></fmiModelDescription>\n"
    )
    library = folder / f"car{fmpy.sharedLibraryExtension}"
    headers, further = Path(fmpy.__file__).parent / "c-code", folder / "further.c"
    further.write_text(further_functions(version))
    assert COMPILER is not None
    subprocess.run([COMPILER, "-shared", "-fPIC", "-O2", f"-DFMI={version[0]}", *options, f"-I{headers}", str(SOURCE),
                    str(further), "-o", str(library), "-lm"], check=True, capture_output=True)  # fmt: skip
    path = folder / f"{version}_{kind}.fmu"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", xml)
        platform = fmpy.platform_tuple if three else fmpy.platform
        archive.write(library, f"binaries/{platform}/{library.name}")
    return path
