"""A page's Content-Security-Policy: it runs the scripts that it was written with, and loads nothing from elsewhere."""

import base64
import hashlib
import re
from collections.abc import Iterable

SCRIPT = re.compile(r"<script(?P<attributes>[^>]*)>(?P<text>.*?)</script>", re.DOTALL | re.IGNORECASE)
DATA = re.compile(r"""\btype\s*=\s*["']?(?:text/plain|application/json)\b""", re.IGNORECASE)
CHARSET = re.compile(r"<meta[^>]*\bcharset\b[^>]*>", re.IGNORECASE)
HEAD = re.compile(r"<head[^>]*>", re.IGNORECASE)


def with_policy(html: str, framed: Iterable[str] = ()) -> str:
    """The page with a policy that names its own scripts by their hashes.

    Styles stand within the page, and pictures and data in its own addresses (`data:`, `blob:`).

    Args:
        framed: pages that this one shows in frames of its own making, which obey its policy too.
    """
    scripts = sorted({f"'{digest(text)}'" for page in (html, *framed) for text in _scripts(page)})
    sources = " ".join(scripts) or "'none'"
    policy = (
        f"default-src 'none'; script-src {sources}; style-src 'unsafe-inline'; img-src data: blob:; font-src data:; "
        "connect-src data: blob:; media-src data: blob:; worker-src blob:; frame-src blob:; base-uri 'none'; "
        "form-action 'none'"
    )
    place = CHARSET.search(html[:1024]) or HEAD.search(html)
    assert place is not None  # every page of ours has a head
    meta = f'\n<meta http-equiv="Content-Security-Policy" content="{policy}">'
    return html[: place.end()] + meta + html[place.end() :]


def digest(script: str) -> str:
    """How a policy names a script."""
    # A browser reads every line break as one, before it hashes.
    text = script.replace("\r\n", "\n").replace("\r", "\n")
    return f"sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}"


def _scripts(html: str) -> list[str]:
    return [found["text"] for found in SCRIPT.finditer(html) if not DATA.search(found["attributes"])]
