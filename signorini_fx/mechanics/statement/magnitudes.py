"""The range of magnitudes that numbers of a scene must have, whatever its units.

Energies, squares of forces and products of stiffness, length and penalty must still be numbers in double precision,
which reaches from 1e-308 to 1e308.
"""

from __future__ import annotations

from signorini_fx.tuned import LARGEST_NUMBER, SMALLEST_NUMBER


def complaint(number: float) -> str | None:
    """What is wrong with a finite number; None if nothing is."""
    if abs(number) > LARGEST_NUMBER:
        return f"must not be larger than {LARGEST_NUMBER:g}, or forces and energies overflow: take other units"
    if 0 < abs(number) < SMALLEST_NUMBER:
        return f"must not be smaller than {SMALLEST_NUMBER:g}, or forces and energies vanish: take other units, or 0"
    return None
