"""What a gap may be instead, in words, and which drive would distinguish it."""

from collections.abc import Mapping, Sequence

from drift_drake.car.effects.catalogue import CATALOGUE

TOO = "+unknown"  # of a hypothesis' name: with an additional fault


def of_rivals(posterior: Mapping[str, float], leading: str) -> dict[str, float]:
    """Probabilities of what it may be instead, largest first; a cause's with an additional fault or without.

    Where a cause is probable with an additional fault alone, it has the name of both.
    """
    out: dict[str, float] = {}
    for name, p in posterior.items():
        cause = name.removesuffix(TOO)
        if cause != leading:
            key = cause if posterior.get(cause, 0.0) >= posterior.get(cause + TOO, 0.0) else cause + TOO
            out[key] = out.get(key, 0.0) + p
    return dict(sorted(out.items(), key=lambda item: -item[1]))


def in_words(name: str) -> str:
    """A hypothesis' name as a sentence has it."""
    causes = name.split("+")
    if len(causes) > 1 and causes[-1] == "unknown":
        return f"{' and '.join(causes[:-1])} with an additional fault"
    return " and ".join(causes)


def tells_apart(leading: str, rivals: Sequence[str]) -> str:
    """The manoeuvres that distinguish a cause from rivals that act alike, in sentences; nothing of others."""
    by_drive: dict[str, list[str]] = {}
    for rival in rivals:
        cause = rival.removesuffix(TOO)
        both = ((CATALOGUE.get(a), b) for a, b in ((leading, cause), (cause, leading)))
        drive = next((one.distinguished_from[b] for one, b in both if one and b in one.distinguished_from), "")
        if drive and cause not in by_drive.setdefault(drive, []):
            by_drive[drive].append(cause)
    return "".join(f" Record {drive}, to distinguish {leading} from {' and '.join(names)}."
                   for drive, names in by_drive.items())  # fmt: skip
