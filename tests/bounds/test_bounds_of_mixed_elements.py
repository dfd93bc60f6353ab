"""The bound of the error of mixed elements, which is that of their displacement alone."""

import error_bounds
import numpy as np
import pytest
from scenes import alone

from signorini_fx.errors import SignoriniError
from signorini_fx.scenes.reading import parse_scene


def drawn(seed, volumetric="mixed", poisson=None):
    """A random scene of degree 2, nearly incompressible or not."""
    scene, chance = error_bounds.drawn(seed), np.random.default_rng([seed, 51])
    fields = {key: getattr(scene, key) for key in scene.model_fields_set - {"solver"}}
    ratio = float(chance.choice([0.3, 0.45, 0.49, 0.499, 0.4999])) if poisson is None else poisson
    return parse_scene(
        fields
        | {
            "material": {"young": float(scene.material[0].young), "poisson": ratio},
            "element": {"degree": 2, "volumetric": volumetric},
        }
    )


def effectivity(seed, poisson=None):
    """Bound over true error, and the bound; or why there is none.

    The finer solution has no pressure of its own, so that its displacement changes the volume as the stress says.
    """
    try:
        solution = alone(drawn(seed, poisson=poisson))
        if isinstance(bound := solution.error_bound, str):
            return bound
        reference = error_bounds.on_finer_mesh(drawn(seed, "full", poisson))
    except SignoriniError as failed:
        return str(failed).splitlines()[0]
    return bound.error / error_bounds.energy_of_difference(solution, reference), bound


@pytest.mark.one_quick
@pytest.mark.parametrize(("seed", "poisson"), [pytest.param(2, 0.3, marks=pytest.mark.slow), (18, 0.49), (2, 0.4999)])
def test_true_errors(seed, poisson):
    """Above the true error and close to it; near nu = 1/2 this is as large as the solution, which the bound says."""
    ratio, bound = effectivity(seed, poisson)
    assert 1 < ratio < 2
    assert (bound.relative < 1) == (poisson < 0.499)
    assert "of the displacement alone" in str(bound)
    assert "of the displacement alone" not in str(alone(drawn(seed, "full", poisson)).error_bound)


@pytest.mark.long
def test_true_errors_of_many():
    """The same of many, with their median."""
    found = [effectivity(seed) for seed in range(40)]
    ratios = [one[0] for one in found if not isinstance(one, str)]
    assert len(ratios) > 20
    assert min(ratios) > 1
    assert np.median(ratios) < 2


def test_without_a_change_of_volume():
    """Nu = 1/2 has no bound."""
    assert "cannot change its volume" in alone(drawn(2, poisson=0.5)).error_bound
