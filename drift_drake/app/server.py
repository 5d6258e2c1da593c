"""The workbench's server: NiceGUI's pages behind the guard, on loopback alone."""

import contextlib
import mimetypes
import os
import secrets
import socket
import tempfile
from collections.abc import AsyncIterator, Callable, Iterator
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

from drift_drake.app.guard import LOOPBACK, Guard, within
from drift_drake.app.project import Project
from drift_drake.common.errors import DriftDrakeError, InvalidOptionError, MissingExtraError

if TYPE_CHECKING:
    from starlette.responses import Response

# Of a file of the folder in a frame: it runs its own scripts in an origin of its own, and reaches nothing.
FRAMED = (
    "sandbox allow-scripts allow-downloads; default-src 'none'; script-src 'unsafe-inline' 'unsafe-eval' blob:; "
    "style-src 'unsafe-inline'; img-src data: blob:; font-src data:; connect-src data: blob:; media-src data: blob:; "
    "worker-src blob:; frame-src blob:; frame-ancestors 'self'"
)

CHUNK = 1 << 16  # bytes of a file that are sent at once
PATIENCE = 60.0  # [s] that a window may be without an answer, on a machine that is busy, before it is forgotten


def bound(port: int) -> socket.socket:
    """A socket on loopback; port 0: a free one.

    Raises:
        InvalidOptionError: the port is taken.
    """
    listening = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listening.bind((LOOPBACK, port))
    except OSError as error:
        listening.close()
        raise InvalidOptionError(f"--port {port}: cannot be used ({error.strerror}); give another, or 0") from None
    return listening


def serve(folder: Path, port: int, ready: Callable[[str], None]) -> None:
    """Serves the folder's workbench until it is ended; `ready` is given its address once it answers.

    Raises:
        InvalidOptionError: the port is taken; MissingExtraError: a package is missing.
    """
    listening = bound(port)
    # NiceGUI keeps what a browser stores in a folder of its own: nothing of this project is kept there.
    os.environ.setdefault("NICEGUI_STORAGE_PATH", str(Path(tempfile.gettempdir()) / f"drift_drake_app_{os.getpid()}"))
    try:
        import uvicorn
        from fastapi import FastAPI, Request
        from nicegui import ui
        from starlette.responses import Response
    except ImportError as error:
        listening.close()
        raise MissingExtraError("the workbench", error.name or "nicegui", "app") from None
    from drift_drake.app.jobs import Jobs
    from drift_drake.app.pages.steps import add_pages
    from drift_drake.app.recordings import Recordings
    from drift_drake.app.uploads import take

    project, token = Project(folder), secrets.token_urlsafe(24)
    readings, jobs = Recordings(folder), Jobs(project)
    number = listening.getsockname()[1]
    address = f"http://{LOOPBACK}:{number}/?token={token}"

    @contextlib.asynccontextmanager
    async def living(_app: FastAPI) -> AsyncIterator[None]:
        ready(address)
        yield
        jobs.end()

    site = FastAPI(openapi_url=None, docs_url=None, redoc_url=None, lifespan=living)

    @site.get("/files/{name:path}")
    def file(name: str) -> Response:
        return response_of(within(folder, name))

    @site.post("/upload")
    async def upload(request: Request, name: str) -> dict[str, str]:
        try:
            return {"taken": await take(project, readings, name, request.stream())}
        except DriftDrakeError as error:
            return {"refused": str(error)}

    add_pages(project, readings, jobs)
    ui.run_with(site, title="drift_drake", dark=None, language="en-US", tailwind=False, favicon=FAVICON,
                show_welcome_message=False, reconnect_timeout=PATIENCE)  # fmt: skip
    config = uvicorn.Config(Guard(site, token, number), log_level="error", ws_max_size=1 << 22, lifespan="on",
                            timeout_graceful_shutdown=1)  # fmt: skip
    listening.listen()
    uvicorn.Server(config).run(sockets=[listening])


def response_of(path: Path | None) -> "Response":
    """A file as it is now, whole, though a command moves it away meanwhile; 404 without one."""
    from starlette.responses import PlainTextResponse, StreamingResponse

    try:
        opened = None if path is None or not path.is_file() else path.open("rb")
    except OSError:
        opened = None
    if path is None or opened is None:
        return PlainTextResponse("no such file in the project's folder\n", 404)
    size = str(os.fstat(opened.fileno()).st_size)
    headers = {"content-security-policy": FRAMED, "cache-control": "no-store", "content-length": size}
    return StreamingResponse(_parts(opened), headers=headers, media_type=mimetypes.guess_type(path.name)[0])


def _parts(opened: BinaryIO) -> Iterator[bytes]:
    with opened:
        yield from iter(partial(opened.read, CHUNK), b"")


FAVICON = (
    '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 32 32"><path d="M4 24C12 24 12 8 28 8" fill="none" '
    'stroke="#0072b2" stroke-width="4"/></svg>'
)
