"""Two bodies of any stiffness and with meshes of any ratio: inf-sup numbers, ratios of moduli,
normals of both.
"""

import numpy as np
import pytest
import scipy.linalg
import scipy.sparse as sp
from on_meshes import no_load
from scipy.sparse.linalg import splu
from two_bodies import KINDS, assembled, facets, facets_of_piece, forms, grid, held, per_cell

from signorini_fx import ContactProblem, Pair


def inf_sup(kind, degree, counts, stiffer=1.0):
    """The least of sup_u (lambda, B u)^2 / a(u, u) over |lambda|^2, of two bonded blocks, in the
    norm of H^(-1/2) that depends on the mesh: |lambda|^2 = sum_i w_i h_i |lambda_i|^2 / E, with E
    of the softer block.

    Args:
        kind: of the cells.
        degree: of the elements.
        counts: facets of the slave and of the master.
        stiffer: E of the slave, with that of the master 1.
    """
    dim = KINDS[kind]
    up = dim - 1
    bodies = [
        grid(kind, (*(n,) * up, max(1, n // 2)), (*(0.0,) * up, z), (*(1.0,) * up, z + 1.0))
        for n, z in zip(counts, (0.0, -1.0), strict=True)
    ]
    mesh = assembled(kind, *bodies)
    space, a, v = forms(mesh, degree, per_cell(mesh, lambda x: stiffer if x[up] > 0 else 1.0))
    both = [
        facets_of_piece(mesh, lambda x: np.isclose(x[up], 0), lambda x, s=s: s * x[up] > 0)
        for s in (1, -1)
    ]
    ends = facets(mesh, lambda x: np.isclose(abs(x[up]), 1))
    nothing = no_load(mesh, v)
    bcs = [held(space, ends, k) for k in range(dim)]
    problem = ContactProblem(
        a, nothing, bcs, contact=Pair(*both, kind="bonded"), linear_algebra="full"
    )
    problem.solve()
    K, B = (
        sp.csc_array(sp.csr_array(matrix.getValuesCSR()[::-1], shape=matrix.getSize()))
        for matrix in (
            problem.assembled.elastic.stiffness,
            problem.assembled.task.system.contact.operator,
        )
    )
    free, weight = ~problem.assembled.elastic.fixed, np.repeat(problem.state.boundary.weight, dim)
    forces = weight[:, None] * B[:, free].toarray()
    schur = forces @ splu(K[free][:, free]).solve(forces.T)
    norm = np.diag(weight ** (dim / up) / min(1.0, stiffer))  # h is w, in 3D its root
    return np.sqrt(scipy.linalg.eigh(schur, norm, eigvals_only=True)[0])


@pytest.mark.one_quick("counts", [(10, 2), (4, 3), (4, 20)])
@pytest.mark.parametrize(
    ("kind", "degree"), [("triangle", 1), ("quadrilateral", 1), ("triangle", 2)]
)
def test_inf_sup_numbers(kind, degree, counts):
    """From 5:1 to 1:5 they do not depend on the mesh; with a slave that is 1000 times softer
    neither.
    """
    for stiffer in (1.0, 1e-3):
        coarse, fine = (inf_sup(kind, degree, [k * n for n in counts], stiffer) for k in (1, 2))
        assert coarse > 0.35
        assert fine == pytest.approx(coarse, rel=0.05)
