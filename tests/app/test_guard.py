"""Who may ask the workbench what: hosts, origins, the token, sizes, and files outside of the folder."""

import asyncio

import pytest

from drift_drake.app.guard import LARGEST_UPLOAD, POLICY, Guard, within
from drift_drake.app.server import response_of

TOKEN, PORT = "secret", 4321
HOST = f"127.0.0.1:{PORT}"
COOKIE = f"drift_drake_{PORT}={TOKEN}"


async def _site(scope, receive, send):
    if scope["type"] == "websocket":
        await send({"type": "websocket.accept"})
        return
    size, message = 0, {"more_body": True}
    while message.get("more_body"):
        message = await receive()
        size += len(message.get("body", b""))
    await send({"type": "http.response.start", "status": 200, "headers": []})
    await send({"type": "http.response.body", "body": str(size).encode()})


def asked(query="", kind="http", body=(b"",), **headers):
    """Status (a close code of a websocket), headers and text of an answer."""
    headers = {"host": HOST, **headers}
    raw = [(name.replace("_", "-").encode(), text.encode()) for name, text in headers.items()]
    scope = {"type": kind, "path": "/columns", "query_string": query.encode(), "headers": raw}
    sent, pieces = [], list(body)

    async def receive():
        return {"type": "http.request", "body": pieces.pop(0), "more_body": bool(pieces)}

    async def send(message):
        sent.append(message)

    asyncio.run(Guard(_site, TOKEN, PORT)(scope, receive, send))
    first = sent[0]
    status = first.get("status", first.get("code", 0))
    said = b"".join(message.get("body", b"") for message in sent).decode()
    return status, {name.decode(): text.decode() for name, text in first.get("headers", [])}, said


def test_the_token_is_asked_for_once_and_then_kept_in_a_cookie():
    status, headers, _ = asked(f"token={TOKEN}")
    assert status == 303
    assert headers["location"] == "/columns"
    assert headers["set-cookie"] == f"{COOKIE}; Path=/; HttpOnly; SameSite=Strict"
    status, headers, _ = asked(cookie=COOKIE)
    assert status == 200
    assert headers["content-security-policy"] == POLICY
    assert "http" not in POLICY  # no other site


@pytest.mark.parametrize(
    ("query", "headers", "status"),
    [
        ("", {}, 403),
        ("token=wrong", {}, 403),
        ("", {"cookie": f"drift_drake_{PORT}=wrong"}, 403),
        (f"token={TOKEN}", {"host": "evil.example"}, 421),  # a name that was made to lead here
        (f"token={TOKEN}", {"host": f"evil.example:{PORT}"}, 421),
        ("", {"cookie": COOKIE, "origin": "http://evil.example"}, 403),
        ("", {"cookie": COOKIE, "content_length": str(LARGEST_UPLOAD + 1)}, 413),
        ("", {"cookie": COOKIE, "content_length": "-1"}, 413),
    ],
)
def test_others_are_refused_in_a_sentence(query, headers, status):
    found, _, said = asked(query, **headers)
    assert found == status
    assert said.count("\n") == 1


def test_a_websocket_needs_the_cookie_and_the_own_origin():
    assert asked(kind="websocket", cookie=COOKIE, origin=f"http://{HOST}")[0] == 0  # accepted
    assert asked(kind="websocket", origin=f"http://{HOST}")[0] == 1008
    assert asked(kind="websocket", cookie=COOKIE, origin="http://evil.example")[0] == 1008


def test_a_body_ends_at_the_limit_whatever_its_length_says(monkeypatch):
    monkeypatch.setattr("drift_drake.app.guard.LARGEST_UPLOAD", 10)
    assert asked(cookie=COOKIE, body=(b"12345", b"123"))[2] == "8"
    assert asked(cookie=COOKIE, body=(b"12345", b"1234567", b"1"))[2] == "5"


def test_files_are_of_the_folder_alone(tmp_path):
    folder = tmp_path / "project"
    folder.mkdir()
    (folder / "a.html").write_text("x")
    (tmp_path / "secret").write_text("x")
    (folder / "link").symlink_to(tmp_path / "secret")
    assert within(folder, "a.html") == (folder / "a.html").resolve()
    for name in ("../secret", "/etc/passwd", "link", "a/../../secret", "\0"):
        assert within(folder, name) is None


def test_a_file_that_is_moved_away_while_it_is_sent_comes_whole(tmp_path):
    """A command that starts moves its results away: the page that shows them may ask for one in that moment."""
    path = tmp_path / "calibrated.html"
    path.write_bytes(b"x" * 200_000)
    pytest.importorskip("starlette", reason="the workbench needs the extra `app`")
    response = response_of(path)
    path.rename(tmp_path / "aside.html")
    assert (response.headers["content-length"], response.media_type) == ("200000", "text/html")

    async def body() -> bytes:
        return b"".join([bytes(part) async for part in response.body_iterator])

    assert asyncio.run(body()) == b"x" * 200_000
    assert response_of(path).status_code == 404
    assert response_of(None).status_code == 404
