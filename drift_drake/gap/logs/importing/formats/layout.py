"""How a text table is written, seen from its first lines: encoding, separator, decimal sign, where its names, units and
rows are. csv.Sniffer guesses from single characters and takes a decimal comma, or a letter, for the separator."""

import codecs
import csv
import dataclasses
import re
from collections import Counter

from drift_drake.common.units import is_stated, meanings
from drift_drake.gap.logs.wording.eastern import SURE
from drift_drake.gap.logs.wording.vocabulary import speaks_of

HEAD = 1 << 18  # bytes that are looked at
MOST_LINES = 600
SEPARATORS = (",", ";", "\t", "|")
BLANKS = r"\s+"  # as separator: columns between blanks
MARKS = ((codecs.BOM_UTF8, "utf-8-sig"), (codecs.BOM_UTF32_LE, "utf-32"), (codecs.BOM_UTF32_BE, "utf-32"),
         (codecs.BOM_UTF16_LE, "utf-16"), (codecs.BOM_UTF16_BE, "utf-16"))  # fmt: skip
EASTERN = ("cp932", "gb18030", "euc_kr", "big5")  # where a text has known words in it
WINDOWS = ("cp1252", "cp1250", "cp1251", "cp1254")  # by the most known words, the first of equals
COMMENTS = ("#", "//", "%")
NUMBER = re.compile(r"[+-]?(\d+([.,]\d*)*|[.,]\d+)([eE][+-]?\d+)?|[+-]?(nan|inf|infinity)", re.IGNORECASE)
TIME = re.compile(r".*\d{1,2}:\d{2}(:\d{2})?([.,:]\d+)?.*|\d{8}T\d{6}.*")
DECIMAL_COMMA = re.compile(r"[+-]?\d*,\d+([eE][+-]?\d+)?")
DECIMAL_POINT = re.compile(r"[+-]?\d*\.\d+([eE][+-]?\d+)?")
BOTH_COMMA, BOTH_POINT = re.compile(r"[+-]?\d{1,3}(\.\d{3})+,\d+"), re.compile(r"[+-]?\d{1,3}(,\d{3})+\.\d+")
MOST_NAMES = 4  # lines above the rows: names, units, sources, a second set of names
FOOTER = 3  # lines below the rows that are no rows


@dataclasses.dataclass(frozen=True)
class Layout:
    """A text table: `start`: the line (from 0) of its first row; names, units: of its columns (units may be empty);
    plain: as pandas reads it by itself, names in the first line, then rows."""

    encoding: str = "utf-8"
    separator: str = ","
    decimal: str = "."
    thousands: str | None = None
    comment: str | None = None
    start: int = 1
    names: tuple[str, ...] = ()
    units: tuple[str, ...] = ()
    plain: bool = True


def layout_of(head: bytes, whole: bool) -> Layout:
    """The layout of a text table by its first bytes (`whole`: there are no more); plain where nothing is like a row."""
    encoding = encoding_of(head)
    text = head.decode(encoding, errors="replace").removeprefix("\ufeff")
    lines = re.split(r"\r\n|\r|\n", text)[:MOST_LINES]
    if not whole and len(lines) > 1 and len(lines) < MOST_LINES:
        lines.pop()  # it may be cut
    separator = _separator(lines)
    if separator is None:
        return Layout(encoding, plain=encoding.startswith("utf-8"))
    rows = [_cells(line, separator) for line in lines]
    block = _block(rows, lines)
    if block is None:
        return Layout(encoding, plain=encoding.startswith("utf-8"))
    start, end = block
    width = max(len(row) for row in rows[start:end])
    above = _above(rows, lines, start, width, separator)
    if not above and _names_readings(rows[start : start + 2]):
        above, start = [(lines[start], rows[start])], start + 1
    names, units = _names_and_units(above, width)
    decimal, thousands = _decimal(rows[start:end])
    comments = any(line.lstrip().startswith("#") for line in lines[start:])
    plain = (
        encoding.startswith("utf-8") and separator == "," and (decimal, thousands) == (".", None) and not comments
        and len(above) == 1
        and len(above[0][1]) == width
        and all(above[0][1]) and not units and not any(map(str.strip, lines[1:start]))
        and bool(lines[0].strip()) and rows[0] == above[0][1]
    )  # fmt: skip
    return Layout(encoding, separator, decimal, thousands, "#" if comments else None, start, names, units, plain)


def encoding_of(head: bytes) -> str:
    """UTF-8, -16, -32 by their marks and zeros, eastern ones and those of Windows by known words in them."""
    for mark, name in MARKS:
        if head.startswith(mark):
            return name
    if head[:2000].count(0) > len(head[:2000]) // 4:
        return "utf-16-le" if head[1:2000:2].count(0) > head[:2000:2].count(0) else "utf-16-be"
    try:
        codecs.getincrementaldecoder("utf-8")().decode(head)
    except UnicodeDecodeError:
        eastern = (name for name in EASTERN if SURE.search(head.decode(name, errors="ignore")))
        return next(eastern, None) or max(WINDOWS, key=lambda name: _known_words(head.decode(name, errors="replace")))
    return "utf-8"


def _known_words(text: str) -> int:
    """How many different words with letters beyond ASCII speak of something."""
    return sum(bool(speaks_of(word)) for word in set(re.findall(r"[^\W\d_]+", text)) if not word.isascii())


def _cells(line: str, separator: str) -> list[str]:
    if separator == BLANKS:
        return line.split()
    try:
        return [cell.strip() for cell in next(csv.reader([line], delimiter=separator, skipinitialspace=True), [])]
    except csv.Error:
        return []


def _is_value(cell: str) -> bool:
    return bool(NUMBER.fullmatch(cell) or TIME.fullmatch(cell))


def _separator(lines: list[str]) -> str | None:
    """The one by which the last lines fall into the largest share of numbers and times, and into the most of them."""
    last = [line for line in lines if line.strip() and not line.lstrip().startswith(COMMENTS)][-40:]
    best, found = (0.0, 0.0), None
    for separator in (*SEPARATORS, BLANKS):
        rows = [_cells(line, separator) for line in last]
        filled = [cell for row in rows for cell in row if cell]
        if not filled or max(map(len, rows)) < 2:
            continue
        width, same = Counter(map(len, rows)).most_common(1)[0]
        values = sum(map(_is_value, filled))
        if width < 2 or not values or (separator == BLANKS and (found is not None or same < len(rows))):
            continue
        score = round(values / len(filled) * same / len(rows), 2), values / len(rows)
        if score > best:
            best, found = score, separator
    return found


def _is_row(row: list[str]) -> bool:
    """Whether a line may be a row of readings: numbers or times in it, and not mostly words."""
    filled = [cell for cell in row if cell]
    values = sum(map(_is_value, filled))
    return values > 0 and 3 * values >= len(filled)


def _block(rows: list[list[str]], lines: list[str]) -> tuple[int, int] | None:
    """First and last line (exclusive) of the readings: the rows of one width up to the last lines."""
    end = len(rows)
    for _ in range(FOOTER):
        while end and not lines[end - 1].strip():
            end -= 1
        if end and _is_row(rows[end - 1]) and len(rows[end - 1]) > 1:
            break
        end -= 1
    if end < 1 or not _is_row(rows[end - 1]):
        return None
    width = Counter(len(row) for row in rows[max(0, end - 40) : end] if row).most_common(1)[0][0]
    start = end
    for number in range(end - 1, -1, -1):
        row, line = rows[number], lines[number]
        if not line.strip() or line.lstrip().startswith(COMMENTS):
            continue
        if not _is_row(row) or len(row) != width or _is_index(row):
            again = rows[max(0, number - 3) : number]
            if len(again) < 3 or not all(_is_row(r) and len(r) == width for r in again):
                break
            continue
        start = number
    return (start, end) if start < end else None


def _names_readings(rows: list[list[str]]) -> bool:
    """Whether the first of two rows has words where the second has readings, and so is the header."""
    return len(rows) > 1 and any(a and not _is_value(a) and _is_value(b) for a, b in zip(*rows, strict=False))


def _is_index(row: list[str]) -> bool:
    """Whether a line counts the columns."""
    return len(row) > 2 and row in ([str(k) for k in range(len(row))], [str(k + 1) for k in range(len(row))])


def _above(
    rows: list[list[str]], lines: list[str], start: int, width: int, separator: str
) -> list[tuple[str, list[str]]]:
    """The lines of names, units and the like directly above the readings, the topmost first."""
    found: list[tuple[str, list[str]]] = []
    commented: list[tuple[str, list[str]]] = []
    for number in range(start - 1, -1, -1):
        row, line = rows[number], lines[number]
        if not line.strip() or _is_index(row):
            if any(not _is_units(cells) for _, cells in found):
                break
            continue
        if line.lstrip().startswith(COMMENTS):
            bare = _cells(line.lstrip().lstrip("#/% "), separator)
            if len(bare) == width and not commented:
                commented.append((line, bare))
            if found:
                break
            continue
        filled = [cell for cell in row if cell]
        fits = abs(len(row) - width) <= 1 or (len(row) <= width and len(filled) >= max(2, width // 2))
        if not fits or 4 * sum(map(_is_value, filled)) > len(filled) or len(found) == MOST_NAMES:
            break
        found.append((line, row))
    return found[::-1] or commented


def _is_units(row: list[str]) -> bool:
    """Whether a line's words are units."""
    filled = [cell for cell in row if is_stated(cell)]
    return bool(filled) and 2 * sum(bool(meanings(cell)) for cell in filled) >= len(filled)


def _names_and_units(above: list[tuple[str, list[str]]], width: int) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Of the columns [width]; units are empty where no line holds them."""
    rows = [[*row, *[""] * width][:width] for _, row in above]
    if not rows:
        return tuple(f"column {k}" for k in range(1, width + 1)), ()
    # Of two rows of the same letters (`t`, `v`, `g`) the lower one has the units.
    units = max(rows[:0:-1] + rows[:1] if len(rows) > 1 else [], key=_share_of_units, default=[])
    if 3.0 * _share_of_units(units) < 1.0:
        units = []
    names = max([row for row in rows if row is not units], key=_likely_names)
    return tuple(names), tuple(units)


def _likely_names(row: list[str]) -> tuple[int, int]:
    """How many cells speak of something (not of a sensor or a bus alone), and how many differ."""
    return sum(bool(speaks_of(cell) - {"source"}) for cell in set(row)), len(set(row) - {""})


def _share_of_units(row: list[str]) -> float:
    filled = [cell for cell in row if is_stated(cell)]
    return sum(bool(meanings(cell)) for cell in filled) / max(1, len(filled))


def _decimal(rows: list[list[str]]) -> tuple[str, str | None]:
    """The sign of decimals, and of thousands."""
    cells = [cell for row in rows for cell in row if cell]
    if any(BOTH_COMMA.fullmatch(cell) for cell in cells):
        return ",", "."
    if any(BOTH_POINT.fullmatch(cell) for cell in cells):
        return ".", ","
    comma = any(DECIMAL_COMMA.fullmatch(cell) for cell in cells)
    return ("," if comma and not any(DECIMAL_POINT.fullmatch(cell) for cell in cells) else "."), None
