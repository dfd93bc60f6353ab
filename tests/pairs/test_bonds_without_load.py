"""A block that is bonded beneath another one, pressed on a foundation and lifted off it: no load is left at all."""

from dataclasses import replace

import numpy as np
import pytest
from scenes import alone

from signorini_fx.results.certificate.certificate import certify
from signorini_fx.results.certificate.law_of_method import Law, PreviousStep, Tractions
from signorini_fx.scenes.reading import parse_scene

FACTORS = (1.0, 0.4, -1.3)


def hanging(**solver):
    """The upper block is moved down and aside, less far, and up."""
    sizes = {"lower": (2.3, 1.3, 3, 1), "upper": (2.6, 0.6, 7, 2)}
    bodies = [
        {
            "name": name,
            "shift": [0.0, 1.3 * k],
            "mesh": {
                "generator": "rectangle",
                "parameters": {"length": size[0], "height": size[1], "nx": size[2], "ny": size[3]},
            },
        }
        for k, (name, size) in enumerate(sizes.items())
    ]
    return parse_scene(
        {
            "body": bodies,
            "material": [
                {"region": "lower", "young": 1120.5, "poisson": -0.3},
                {"region": "upper", "young": 1120.5, "poisson": 0.3},
            ],
            "displacement": {"boundary": "upper.top", "x": -3.47e-4, "y": -3.09e-4, "factors": list(FACTORS)},
            "contact": [
                {"boundary": "lower.top", "against": "upper.bottom", "points": "boundary", "kind": "bonded"},
                {"boundary": "lower.bottom", "friction": {"law": "coulomb", "coefficient": 0.23}},
            ],
            "solver": solver,
        }
    )


@pytest.mark.parametrize("solver", [{"algorithm": "alm"}, {"algorithm": "alm", "coulomb": "newton"}, {}])
def test_lifted(solver):
    """The bodies hang on the support without stress: that is found in a few solves, by the method asked for."""
    solution = alone(hanging(**solver))
    lifted = solution.steps[-1]
    assert lifted.linear_solves <= 12
    assert solution.certificate.law.regularised == (not solver)
    moved = np.array([-3.47e-4, -3.09e-4]) * FACTORS[-1]
    difference = solution.displacement.x.array.reshape(-1, 2) - moved
    assert np.abs(difference).max() <= 1e-9 * np.abs(moved).max()


def test_wrong_states_are_refused():
    """A millionth of the displacement at a node, or of the tractions of the step before, is seen.

    What counts as round-off is that of the tractions, which are gamma times displacements.
    """
    solution = alone(hanging(algorithm="alm"))
    before, lifted = solution.steps[-2], solution.steps[-1]
    law = Law(penalty=solution.model.data.gamma_n)
    last = PreviousStep.of(before.displacement, Tractions.of(before.contact), law, None)
    right = Tractions.of(lifted.contact)

    def judged(displacement=lifted.displacement, tractions=right):
        return certify(
            solution.statement,
            solution.model.tagged,
            displacement,
            tractions,
            law=law,
            step=lifted.place,
            before=last,
            pairs=solution.model.pairs,
        )

    assert judged().holds
    pressed = Tractions.of(before.contact)
    for share in (1e-6, -1e-6):
        bond = pressed.part == 0
        for changed in (
            {"pressure": right.pressure + share * pressed.pressure * bond},
            {"shear": right.shear + share * pressed.shear * bond[:, None]},
            {"pressure": right.pressure + share * pressed.pressure * ~bond},
        ):
            assert not judged(tractions=replace(right, **changed)).holds, (share, changed)
        free = np.flatnonzero(np.abs(before.displacement.x.array - before.displacement.x.array.max()) > 0)
        for unknown in free[:: len(free) // 5]:
            wrong = lifted.displacement.copy()
            wrong.x.array[unknown] += share * np.abs(before.displacement.x.array).max()
            assert not judged(wrong).holds, unknown
