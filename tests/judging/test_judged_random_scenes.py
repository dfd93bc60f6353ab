"""Our own solutions of random scenes, which are coarse and askew: the judge finds no fault in them, and one of 5 %."""

import sys
from pathlib import Path

import pytest
from mpi4py import MPI

sys.path.insert(0, str(Path(__file__).parents[2]))

import signorini_fx as sfx
from signorini_fx.addons.judging.judge import judge
from signorini_fx.addons.judging.own_solution import at_nodes_of
from signorini_fx.addons.judging.problems import judged_problem
from stability.oracle.worker import TRIAL

# What each has, by its kind and seed.
SCENES = {
    "a load that jumps inside facets": ("plane", 81003),
    "a load that jumps, quadrilaterals": ("plane", 81029),
    "distorted quadrilaterals": ("plane", 81023),
    "a side with kinks, volumes with fewer points": ("plane", 81010),
    "a gap that jumps": ("plane", 81034),
    "distorted quadrilaterals, volumes with fewer points": ("plane", 81055),
    "plane stress without a free node": ("plane", 81073),
    "contact at a node of facets that rise": ("effects", 81013),
    "hexahedra": ("space", 81009),
}


def solved(kind, seed, folder):
    """The scene, its problem and the displacement at the nodes."""
    scene = sfx.read_scene(TRIAL[kind](seed).write(folder))
    problem, reasons = judged_problem(scene)
    assert reasons == []
    solution = sfx.solve(scene, MPI.COMM_SELF, check=False)
    assert solution.converged
    return scene, at_nodes_of(solution, problem)


@pytest.mark.parametrize("name", SCENES)
def test_solutions_of_random_scenes_agree(name, tmp_path):
    """In equilibrium to what quadrature of distorted cells leaves; not if all of it is 5 % larger."""
    scene, v = solved(*SCENES[name], tmp_path)
    judgement = judge(scene, v, compare=False)
    assert judgement.word in ("agrees", "agrees with another penalty"), str(judgement)
    if scene.statement.displacement and judgement.figures["equilibrium"]["value"] > 0:
        assert judgement.figures["equilibrium"]["value"] < 1e-4
        assert not judge(scene, 1.05 * v, compare=False).word.startswith("agrees")


def test_a_rigid_motion_has_no_strain(tmp_path):
    """Its strains and forces are those that solvers leave, in which no fault is seen."""
    scene, v = solved("bodies", 81049, tmp_path)
    judgement = judge(scene, v, compare=False)
    assert judgement.word in ("agrees", "cannot be judged"), str(judgement)
