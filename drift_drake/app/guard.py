"""Who may ask the workbench what: this machine's browser with the token, for files of the folder, in bounded sizes."""

import hmac
from collections.abc import Awaitable, Callable, MutableMapping
from http.cookies import CookieError, SimpleCookie
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs, urlsplit

Scope = MutableMapping[str, Any]
Asgi = Callable[[Scope, Callable[[], Awaitable[Any]], Callable[[Any], Awaitable[None]]], Awaitable[None]]

LARGEST_UPLOAD = 1 << 30  # bytes of one request: a recording
LOOPBACK = "127.0.0.1"
# NiceGUI evaluates its own templates; nothing is loaded from, and nothing sent to, anywhere but this server.
POLICY = (
    "default-src 'none'; script-src 'self' 'unsafe-inline' 'unsafe-eval'; style-src 'self' 'unsafe-inline'; "
    "img-src 'self' data: blob:; font-src 'self' data:; connect-src 'self'; frame-src 'self'; worker-src blob:; "
    "base-uri 'self'; form-action 'self'; frame-ancestors 'self'"
)
HEADERS = {
    "content-security-policy": POLICY, "x-content-type-options": "nosniff", "referrer-policy": "no-referrer",
    "cross-origin-opener-policy": "same-origin", "cross-origin-resource-policy": "same-origin",
}  # fmt: skip


class Guard:
    """ASGI middleware: refuses requests of another host or origin, without the token, or with too large a body.

    The address that is opened first has the token as `?token=`; a cookie has it from then on, so that no later address
    shows it.
    """

    def __init__(self, app: Asgi, token: str, port: int) -> None:
        self.app, self.token = app, token
        self.hosts = {f"{LOOPBACK}:{port}", f"localhost:{port}"}
        self.cookie = f"drift_drake_{port}"

    async def __call__(self, scope: Scope, receive: Callable[[], Awaitable[Any]], send: Any) -> None:
        if scope["type"] not in ("http", "websocket"):
            await self.app(scope, receive, send)
            return
        headers = {name.decode("latin-1").lower(): value.decode("latin-1") for name, value in scope["headers"]}
        refusal, asked = self._refusal(scope, headers)
        if refusal is not None:
            await _refuse(scope, receive, send, *refusal)
            return
        if asked:
            kept = f"{self.cookie}={self.token}; Path=/; HttpOnly; SameSite=Strict"
            headed = [(b"location", scope["path"].encode()), (b"set-cookie", kept.encode())]
            await send({"type": "http.response.start", "status": 303, "headers": headed})
            await send({"type": "http.response.body", "body": b""})
            return

        async def answer(message: Any) -> None:
            if message["type"] == "http.response.start":
                own = {name.lower() for name, _ in message["headers"]}
                more = [(name.encode(), text.encode()) for name, text in HEADERS.items() if name.encode() not in own]
                message = {**message, "headers": [*message["headers"], *more]}
            await send(message)

        await self.app(scope, _bounded(receive) if scope["type"] == "http" else receive, answer)

    def _refusal(self, scope: Scope, headers: dict[str, str]) -> tuple[tuple[int, str] | None, bool]:
        """Status and sentence of a refusal, None of what is let through; whether the address has the token."""
        if headers.get("host", "") not in self.hosts:
            return (421, "this address is not the workbench's; open the one that it printed"), False
        origin = headers.get("origin")
        if origin not in (None, "null") and urlsplit(str(origin)).netloc not in self.hosts:
            return (403, "a page of another site may not ask the workbench"), False
        given = parse_qs(scope["query_string"].decode("latin-1")).get("token", [""])[0]
        asked = hmac.compare_digest(given.encode(), self.token.encode())
        kept = _cookie(headers.get("cookie", ""), self.cookie)
        if not asked and not hmac.compare_digest(kept.encode(), self.token.encode()):
            return (403, "the token is missing; open the address that the workbench printed"), False
        length = headers.get("content-length", "0")
        if not length.isdigit() or int(length) > LARGEST_UPLOAD:
            return (413, f"at most {LARGEST_UPLOAD >> 20} MB a file; put larger ones into the folder yourself"), False
        return None, asked and scope["type"] == "http"


def _cookie(text: str, name: str) -> str:
    try:
        found = SimpleCookie(text).get(name)
    except CookieError:
        return ""
    return "" if found is None else found.value


def _bounded(receive: Callable[[], Awaitable[Any]]) -> Callable[[], Awaitable[Any]]:
    """Ends a body that goes on beyond the limit, whatever its headers said."""
    seen = 0

    async def counted() -> Any:
        nonlocal seen
        message = await receive()
        seen += len(message.get("body", b""))
        return {"type": "http.disconnect"} if seen > LARGEST_UPLOAD else message

    return counted


async def _refuse(scope: Scope, receive: Callable[[], Awaitable[Any]], send: Any, status: int, sentence: str) -> None:
    if scope["type"] == "websocket":
        await receive()
        await send({"type": "websocket.close", "code": 1008})
        return
    headers = [(b"content-type", b"text/plain; charset=utf-8"), (b"connection", b"close")]
    await send({"type": "http.response.start", "status": status, "headers": headers})
    await send({"type": "http.response.body", "body": f"{sentence}\n".encode()})


def within(folder: Path, name: str) -> Path | None:
    """The file or folder of that relative name within the folder, links followed; None where it is outside of it."""
    try:
        path = (folder / name).resolve()
    except (OSError, ValueError):
        return None
    return path if path.is_relative_to(folder.resolve()) else None
