"""Derivatives of results of scenes against central differences of solves."""

import numpy as np
from mpi4py import MPI

from signorini_fx import sensitivity
from signorini_fx.addons.derivatives.of_scene import varied

COMM = MPI.COMM_WORLD


COULOMB = {"law": "coulomb", "coefficient": 0.3}


TRESCA = {"law": "tresca", "bound": 1.5}


def agrees(scene, of, by, tolerance=1e-5):
    """The derivatives are the central differences; those that are round-off beside the others of a
    result are not compared.
    """
    found = sensitivity(scene, of, by, COMM)
    assert all(one.between == 0 for one in found)
    slopes = np.array([one.derivatives for one in found])
    data = np.array(
        [1.0 if datum == 0 or not np.isfinite(datum) else abs(datum) for datum in found[0].data]
    )
    for k, path in enumerate(by):
        step = 1e-5 * data[k] if "gap" not in path and "foundation" not in path else 1e-5
        scenes = (
            scene.model_copy(update=varied(scene.statement, path, sign * step, 3))
            for sign in (1, -1)
        )
        high, low = (
            np.array([one.value for one in sensitivity(changed, of, [], COMM)])
            for changed in scenes
        )
        wanted = (high - low) / (2 * step)
        values = np.abs([one.value for one in found])
        least = 1e-7 * values / data[k] + 1e-11 * values.max() / step  # round-off of the solves
        away = np.abs(slopes[:, k] - wanted)
        assert (away <= tolerance * np.abs(wanted) + least).all(), (path, slopes[:, k], wanted)
    return found
