"""Inputs spoilt without Hypothesis, so that a long campaign draws them in microseconds: by bytes, structure, cells."""

import copy
from random import Random
from typing import Any

NUMBERS = [0, 1, -1, 2, 3, 1e-9, -0.1, 0.5, 5.0, 1e3, 1e9, 1e18, 1e300, -1e300, 5e-324, float("nan"), float("inf"),
           -float("inf"), 2**31, 2**63, -(2**63), 10**400]  # fmt: skip
TEXTS = [
    "",
    " ",
    "$x_1$",
    "nan",
    "-inf",
    "1e5",
    "1e999",
    "none",
    "unknown",
    "a+b",
    "../x",
    "\x00",
    "\n",
    "\t",
    "ü",
    "速度",
    "\u202e",
    "x" * 3000,
    "=1+1",
    "0x1F",
    "1_000",
    "1,5",
    "12:00:00",
    "2024-02-30",
    "NaT",
    "?",
    "~",
    "*a",
    "&a [*a]",
    "!!python/object:os.system",
    "{",
    "]",
    "'",
    '"',
    "#",
    "\ufeff",
    "\ud800",
    "True",
    "-",
    "--",
    "deg/s",
    "km/h",
    "g",
    "rad",
    "time",
    "r",
    "v",
    "delta_cmd",
]
WORDS = [
    b"\xff" * 4,
    b"\x00" * 8,
    b"\xff\xff\xff\x7f",
    b"\xff" * 8,
    b"\x01\x00\x00\x00",
    b"\r\n",
    b"\n\n",
    b",,,,",
    b";",
    b"nan",
    b"1e999",
    b"\xef\xbb\xbf",
    b"\xff\xfe",
    b"\x1f\x8b",
    b"\x00\x00\xf0\x7f",
    b"\x00\x00\xf8\xff",
]


def scalar(rng: Random) -> Any:
    return rng.choice([
        lambda: None, lambda: rng.random() < 0.5, lambda: rng.choice(NUMBERS), lambda: rng.choice(TEXTS),
        lambda: rng.gauss(0.0, 10.0 ** rng.randint(-3, 6)), lambda: rng.randint(-1000, 1000),
    ])()  # fmt: skip


def junk(rng: Random, depth: int = 2) -> Any:
    kind = rng.randrange(6) if depth else 0
    if kind == 4:
        return [junk(rng, depth - 1) for _ in range(rng.randint(0, 3))]
    if kind == 5:
        return {rng.choice(TEXTS): junk(rng, depth - 1) for _ in range(rng.randint(0, 3))}
    return scalar(rng)


def places(data: Any) -> list[tuple[Any, Any]]:
    """(parent, key) of all nodes."""
    keys = list(data) if isinstance(data, dict) else range(len(data)) if isinstance(data, list) else []
    return [(data, key) for key in keys] + [place for key in keys for place in places(data[key])]


def spoilt_tree(rng: Random, data: Any, most: int = 3) -> Any:
    """Plain data with one to `most` nodes replaced, taken out, renamed, doubled or exchanged."""
    data = copy.deepcopy(data)
    for _ in range(rng.randint(1, most)):
        found = places(data)
        if not found:
            return junk(rng)
        parent, key = rng.choice(found)
        kind = rng.choice(["replace", "number", "number", "text", "remove", "rename", "add", "exchange"])
        if kind in ("replace", "number", "text"):
            parent[key] = {"replace": junk(rng), "number": rng.choice(NUMBERS), "text": rng.choice(TEXTS)}[kind]
        elif kind == "remove":
            del parent[key]
        elif kind == "exchange":
            other, there = rng.choice(found)
            if there in other if isinstance(other, dict) else there < len(other):
                parent[key] = copy.deepcopy(other[there])
        elif isinstance(parent, list):
            parent.insert(key, junk(rng))
        else:
            parent[rng.choice(TEXTS)] = parent.pop(key) if kind == "rename" else junk(rng)
    return data


def spoilt_bytes(rng: Random, content: bytes) -> bytes:
    """A file's bytes cut, changed, put in, doubled, taken out, or exchanged for hostile ones."""
    out = bytearray(content)
    for _ in range(rng.choice([1, 1, 1, 2, 4, 16])):
        at = rng.randrange(len(out) + 1)
        length = rng.choice([1, 2, 4, 8, 64, 500])
        kind = rng.choice(["cut", "flip", "flip", "byte", "word", "put in", "repeat", "take out", "move", "noise"])
        if kind == "cut" and rng.random() < 0.3:
            del out[at:]
        elif kind == "flip" and out:
            out[at % len(out)] ^= 1 << rng.randrange(8)
        elif kind == "byte" and out:
            out[at % len(out)] = rng.choice([0, 1, 0x7F, 0x80, 0xFF, rng.randrange(256)])
        elif kind == "word":
            word = rng.choice(WORDS)
            out[at : at + len(word)] = word
        elif kind == "put in":
            out[at:at] = rng.choice(WORDS)
        elif kind == "repeat":
            out[at:at] = out[max(at - length, 0) : at] * rng.choice([1, 1, 50])
        elif kind == "take out":
            del out[at : at + length]
        elif kind == "move" and out:
            there = rng.randrange(len(out))
            out[at : at + length] = out[there : there + length]
        elif kind == "noise":
            out[at : at + length] = rng.randbytes(length)
    return bytes(out)


def spoilt_table(rng: Random, rows: list[list[str]]) -> list[list[str]]:
    """A table's cells, rows and columns replaced, emptied, exchanged, doubled, taken out; ragged rows."""
    rows = [list(row) for row in rows]
    for _ in range(rng.choice([1, 1, 2, 4])):
        if not rows:
            return rows
        at, column = rng.randrange(len(rows)), rng.randrange(max(len(rows[0]), 1))
        kind = rng.choice(
            ["cell", "cell", "name", "row", "column", "empty", "double", "shuffle", "constant", "ragged", "few"]
        )
        if kind == "cell" and rows[at]:
            rows[at][column % len(rows[at])] = str(scalar(rng))
        elif kind == "name" and rows[0]:
            rows[0][column % len(rows[0])] = rng.choice([*TEXTS, rng.choice(rows[0])])
        elif kind == "row":
            rows.insert(at, [str(scalar(rng)) for _ in range(rng.choice([0, 1, len(rows[0]), 2 * len(rows[0])]))])
        elif kind in ("column", "empty", "constant"):
            value = str(scalar(rng))
            share = rng.choice([1.0, 0.9, 0.5])
            for row in rows[rng.choice([0, 1, 2]) :]:
                if column < len(row) and rng.random() < share:
                    row[column] = {"column": str(scalar(rng)), "empty": "", "constant": value}[kind]
        elif kind == "double":
            rows = [[*row[: column + 1], *row[column:]] for row in rows]
        elif kind == "shuffle":
            body = rows[1:]
            rng.shuffle(body)
            rows[1:] = body
        elif kind == "ragged":
            for row in rng.sample(rows, min(3, len(rows))):
                row.append(rng.choice(TEXTS)) if rng.random() < 0.5 else row.clear()
        elif kind == "few":
            rows = rows[: rng.randint(0, 5)]
    return rows
