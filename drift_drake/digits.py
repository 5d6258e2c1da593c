"""Numbers as people write them."""

from decimal import Decimal


def significant(value: float, digits: int = 3) -> str:
    """A number in so many significant digits, never as a power of ten."""
    return format(Decimal(f"{value:.{digits}g}"), "f")
