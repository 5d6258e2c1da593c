"""What a gap may be instead, in words, and which drive would tell."""

from collections.abc import Sequence

from drift_drake.car.effects.manoeuvres import TELLS_APART

TOO = "+unknown"  # of a hypothesis' name: and something else too


def in_words(name: str) -> str:
    """A hypothesis' name as a sentence has it."""
    causes = name.split("+")
    if len(causes) > 1 and causes[-1] == "unknown":
        return f"{' and '.join(causes[:-1])} with an additional fault"
    return " and ".join(causes)


def tells_apart(leading: str, rivals: Sequence[str]) -> str:
    """The manoeuvres that tell a cause from rivals that act alike, in sentences; nothing of others."""
    by_drive: dict[str, list[str]] = {}
    for rival in rivals:
        cause = rival.removesuffix(TOO)
        drive = TELLS_APART.get(frozenset((leading, cause)))
        if drive and cause not in by_drive.setdefault(drive, []):
            by_drive[drive].append(cause)
    return "".join(f" {drive[0].upper()}{drive[1:]}, would tell {leading} from {' and '.join(names)}."
                   for drive, names in by_drive.items())  # fmt: skip
