"""How inputs are spoilt: structures by their nodes, files by their bytes."""

import copy
from typing import Any

from hypothesis import strategies as st

NUMBERS = st.one_of(
    st.sampled_from([0, 1, -1, 2, 1e-9, -0.1, 0.5, 5.0, 1e3, 1e9, 1e300, -1e300, float("nan"), float("inf"), 10**400]),
    st.floats(),
    st.integers(-1000, 1000),
)
TEXTS = st.one_of(
    st.sampled_from(["", " ", "$x_1$", "nan", "1e5", "none", "unknown", "a+b", "../x", "\x00", "\n", "ü", "x" * 3000]),
    st.text(max_size=8),
)
SCALARS = st.one_of(st.none(), st.booleans(), NUMBERS, TEXTS)
JUNK = st.recursive(
    SCALARS, lambda inner: st.lists(inner, max_size=3) | st.dictionaries(TEXTS, inner, max_size=3), max_leaves=5
)


@st.composite
def mutated(draw: st.DrawFn, data: Any, most: int = 3) -> Any:
    """Plain data with one to `most` nodes replaced, taken out, renamed or doubled."""
    data = copy.deepcopy(data)
    for _ in range(draw(st.integers(1, most))):
        places = _places(data)
        if not places:
            return draw(JUNK)
        parent, key = places[draw(st.integers(0, len(places) - 1))]
        kind = draw(st.sampled_from(["replace", "replace", "number", "remove", "rename", "add"]))
        if kind == "replace":
            parent[key] = draw(JUNK)
        elif kind == "number":
            parent[key] = draw(NUMBERS)
        elif kind == "remove":
            del parent[key]
        elif isinstance(parent, list):
            parent.insert(key, draw(JUNK))
        elif kind == "rename":
            parent[draw(TEXTS)] = parent.pop(key)
        else:
            parent[draw(TEXTS)] = draw(JUNK)
    return data


def _places(data: Any) -> list[tuple[Any, Any]]:
    """(parent, key) of all nodes."""
    keys = list(data) if isinstance(data, dict) else range(len(data)) if isinstance(data, list) else []
    return [(data, key) for key in keys] + [place for key in keys for place in _places(data[key])]


@st.composite
def spoilt(draw: st.DrawFn, content: bytes) -> bytes:
    """A file's bytes cut, with bytes changed or put in, or nothing of it."""
    kind = draw(st.sampled_from(["cut", "flip", "insert", "repeat", "other"]))
    if kind == "other":
        return draw(st.binary(max_size=60))
    at = draw(st.integers(0, len(content)))
    if kind == "cut":
        return content[:at]
    if kind == "insert":
        return content[:at] + draw(st.binary(min_size=1, max_size=6)) + content[at:]
    if kind == "repeat":
        return content[:at] + content[max(at - draw(st.integers(1, 200)), 0) :]
    out = bytearray(content)
    for _ in range(draw(st.integers(1, 4))):
        out[draw(st.integers(0, len(out) - 1))] ^= 1 << draw(st.integers(0, 7))
    return bytes(out)
