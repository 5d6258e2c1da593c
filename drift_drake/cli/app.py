"""`drift-drake app`: the workbench, from a dropped file to a corrected simulator in a browser."""

import dataclasses
import webbrowser
from pathlib import Path

import tyro

from drift_drake.common.errors import OutputError
from drift_drake.common.interruption import ended_at_once
from drift_drake.common.safe_files import try_folder, try_outputs
from drift_drake.common.standard_output import said_to, write_results


@dataclasses.dataclass(frozen=True)
class App:
    """Open the workbench: logs, columns, check, calibration, diagnosis and correction of a folder, in a browser.

    drift-drake app mycar

    All of it is kept in files of the folder. Every step shows the command that does the same. Only this machine, with
    the address that is printed, can open it. Ctrl-C ends it.
    """

    folder: tyro.conf.Positional[Path] = Path(".")
    """Folder of the project; made where there is none."""
    port: int = 0
    """Port on 127.0.0.1 (0: a free one)."""
    open: bool = True
    """Open a browser."""
    json: Path | None = None
    """Where to write the address, as JSON (-: standard output)."""


def run_app(command: App) -> None:
    if command.folder.exists() and not command.folder.is_dir():
        raise OutputError(f"{command.folder}: is a file; give a folder")
    try_outputs({"--json": command.json})
    try_folder(command.folder, "FOLDER")
    with ended_at_once():
        from drift_drake.app.server import serve

    def ready(address: str) -> None:
        write_results(command.json, {"folder": command.folder, "address": address})
        print(f"{command.folder}: open {address} (Ctrl-C ends the workbench)", file=said_to(command.json), flush=True)
        if command.open:
            webbrowser.open(address)

    serve(command.folder.resolve(), command.port, ready)
