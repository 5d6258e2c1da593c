"""The words of a column's name, and what they speak of."""

import functools
import re
import unicodedata

from drift_drake.gap.logs.wording.vocabulary import WORDS

CORNERS = ("fl", "fr", "rl", "rr", "vl", "vr", "hl", "hr")
LONGEST = 200  # characters of a name that is read


@functools.lru_cache(maxsize=8192)
def pieces(name: str) -> tuple[str, ...]:
    """The words of a name in lower case, without accents, cut at signs, capitals and digits, and compounds apart."""
    plain = unicodedata.normalize("NFKD", name.replace("ß", "ss").replace("œ", "oe").replace("Œ", "Oe"))
    plain = "".join(letter for letter in plain if not unicodedata.combining(letter))
    found: list[str] = []
    for word in re.findall(r"[A-Z]+(?=[A-Z][a-z])|[A-Z]?[a-z]+|[A-Z]+|\d+", plain):
        word = word.lower()
        if found and found[-1] + word in WORDS and (len(found[-1]) == 1 or len(word) == 1):
            found[-1] += word  # v_x, g-force, gLat
        elif found and (found[-1], word) == ("g", "force"):
            found[-1] = "gforce"
        else:
            found += pieces_of_compound(word)
    return tuple(found)


@functools.lru_cache(maxsize=8192)
def pieces_of_compound(word: str) -> list[str]:
    """The words of a compound, as few as will do; itself where it is none of known words."""
    if word in WORDS or word.isdigit() or len(word) > 60:
        return [word]
    best: list[list[str] | None] = [[]] + [None] * len(word)
    for end in range(1, len(word) + 1):
        for start in range(end):
            before, part = best[start], word[start:end]
            known = (len(part) > 2 and part in WORDS) or (end == len(word) and start > 2 and part in (*"xyz", *CORNERS))
            if before is None or not (known or (part == "s" and len(before) > 0)):
                continue
            cut = before if part == "s" else [*before, part]
            if best[end] is None or len(cut) < len(best[end] or []):
                best[end] = cut
    return best[-1] or [word]


def speaks_of(name: str) -> set[str]:
    """The concepts that a name's words speak of."""
    return {concept for word in pieces(name[:LONGEST]) for concept in WORDS.get(word, ())}
