"""The scenes of Figures 2 to 9 of the paper, drawn as all results are; Figure 1 shows no result."""

from __future__ import annotations

from collections.abc import Callable

from signorini_fx import Scene

from .scenes import coulomb, example1, example2, tresca

FIGURES: dict[int, Callable[[], dict[str, Scene]]] = {
    2: lambda: {"g=1.5": example1(tresca(1.5))},
    3: lambda: {"g=1.5": example1(tresca(1.5))},
    4: lambda: {"F=0.3": example1(coulomb(0.3), algorithm="alm")},
    5: lambda: {f"F={value:g}": example1(coulomb(value), algorithm="alm") for value in (0.1, 1.0)},
    6: lambda: {"g=1": example2(tresca(1.0))},
    7: lambda: {"g=1": example2(tresca(1.0))},
    8: lambda: {f"g={value:g}": example2(tresca(value)) for value in (0.0, 1.0, 5.0)},
    9: lambda: {
        f"F={value:g}": example2(coulomb(value), algorithm="alm") for value in (2.0, 5.0, 10.0)
    },
}
