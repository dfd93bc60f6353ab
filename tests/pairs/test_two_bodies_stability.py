"""Two bodies of any stiffness and with meshes of any ratio: inf-sup numbers, ratios of moduli, normals of both."""

import numpy as np
import pytest
import scipy.linalg
import scipy.sparse as sp
import ufl
from dolfinx import fem
from scipy.sparse.linalg import splu
from test_two_bodies_references import cap
from two_bodies import KINDS, assembled, facets, facets_of_piece, forms, grid, held, per_cell

from signorini_fx import ContactProblem, Coulomb, Pair
from signorini_fx.algebra.linalg.multigrid import ContactPreconditioner


def inf_sup(kind, degree, counts, stiffer=1.0):
    """The least of sup_u (lambda, B u)^2 / a(u, u) over |lambda|^2, of two bonded blocks, in the norm of H^(-1/2) that
    depends on the mesh: |lambda|^2 = sum_i w_i h_i |lambda_i|^2 / E, with E of the softer block.

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
    both = [facets_of_piece(mesh, lambda x: np.isclose(x[up], 0), lambda x, s=s: s * x[up] > 0) for s in (1, -1)]
    ends = facets(mesh, lambda x: np.isclose(abs(x[up]), 1))
    nothing = ufl.inner(fem.Constant(mesh, (0.0,) * dim), v) * ufl.dx
    bcs = [held(space, ends, k) for k in range(dim)]
    problem = ContactProblem(a, nothing, bcs, contact=Pair(*both, bonded=True), linear_algebra="full")
    problem.solve()
    K, B = (
        sp.csc_array(sp.csr_array(matrix.getValuesCSR()[::-1], shape=matrix.getSize()))
        for matrix in (problem.assembled.elastic.stiffness, problem.assembled.task.system.contact.operator)
    )
    free, weight = ~problem.assembled.elastic.fixed, np.repeat(problem.state.boundary.weight, dim)
    forces = weight[:, None] * B[:, free].toarray()
    schur = forces @ splu(K[free][:, free]).solve(forces.T)
    norm = np.diag(weight ** (dim / up) / min(1.0, stiffer))  # h is w, in 3D its root
    return np.sqrt(scipy.linalg.eigh(schur, norm, eigvals_only=True)[0])


@pytest.mark.one_quick
@pytest.mark.parametrize("counts", [(10, 2), (4, 3), (4, 20)])
@pytest.mark.parametrize(("kind", "degree"), [("triangle", 1), ("quadrilateral", 1), ("triangle", 2)])
def test_inf_sup_numbers(kind, degree, counts):
    """From 5:1 to 1:5 they do not depend on the mesh; with a slave that is 1000 times softer neither."""
    for stiffer in (1.0, 1e-3):
        coarse, fine = (inf_sup(kind, degree, [k * n for n in counts], stiffer) for k in (1, 2))
        assert coarse > 0.35
        assert fine == pytest.approx(coarse, rel=0.05)


@pytest.mark.one_quick
@pytest.mark.parametrize(
    ("kind", "least"), [("hexahedron", 0.5), pytest.param("tetrahedron", 0.3, marks=pytest.mark.long)]
)
def test_inf_sup_numbers_in_space(kind, least):
    """From 5:1 to 1:5, with a slave as stiff or 1000 times softer: bounded from below, on a finer mesh too."""
    for stiffer in (1.0, 1e-3):
        for counts in ((5, 1), (2, 3)):
            coarse, fine = (inf_sup(kind, 1, [k * n for n in counts], stiffer) for k in (1, 2))
            assert fine > least
            assert 0.92 * min(coarse, 0.6) < fine  # one facet on a side is not yet like a fine mesh
        assert inf_sup(kind, 1, (2, 10), stiffer) > least


def test_why_the_softer_side_has_the_points():
    """A slave that is stiffer and finer has multipliers that the other side cannot follow, if it is not as fine."""
    assert inf_sup("triangle", 1, (12, 4), 1e3) < 0.02
    assert inf_sup("triangle", 1, (4, 12), 1e3) > 0.5


def cap_in_plane(radius, sign, along, through, size=3.0, power=1.7):
    """The half of a body with a rounded face at the origin, as ``cap``."""
    cells, x = grid("quadrilateral", (along, through), (0, 0), (1, 1))
    x = size * x**power
    face = x[:, 0] ** 2 / (2 * radius)
    return cells, np.column_stack((x[:, 0], sign * (face + (size - face) * x[:, 1] / size)))


def pressed(dim, counts, young=(200.0, 200.0), radii=(8.0, 12.0), depth=0.05, slave=0, **given):
    """Two rounded bodies pressed together: the problem, and Hertz's half width and largest pressure for its force."""
    make, kind, up = (cap_in_plane, "quadrilateral", 1) if dim == 2 else (cap, "hexahedron", 2)
    bodies = [make(r, s, *n) for r, s, n in zip(radii, (1.0, -1.0), counts, strict=True)]
    mesh = assembled(kind, *bodies)
    space, a, v = forms(mesh, 1, per_cell(mesh, lambda x: young[0] if x[up] > 0 else young[1]))
    sides = [
        facets_of_piece(
            mesh,
            lambda x, r=r, s=s: np.isclose(x[up], s * (x[:up] ** 2).sum(axis=0) / (2 * r)),
            lambda x, s=s: s * x[up] > 0,
        )
        for r, s in zip(radii, (1.0, -1.0), strict=True)
    ]
    ends = [facets(mesh, lambda x, z=z: np.isclose(x[up], z)) for z in (3.0, -3.0)]
    bcs = [held(space, facets(mesh, lambda x, k=k: np.isclose(x[k], 0.0)), k) for k in range(up)]
    bcs += [held(space, ends[0], up, -depth), held(space, ends[1], up)]
    nothing = ufl.inner(fem.Constant(mesh, (0.0,) * dim), v) * ufl.dx
    pair = Pair(sides[slave], sides[1 - slave], friction=given.pop("friction", None))
    problem = ContactProblem(a, nothing, bcs, contact=pair, **given)
    problem.solve()
    force = 2**up * abs(problem.state.forces[0][up])
    stiffness, radius = 1 / sum((1 - 0.3**2) / e for e in young), 1 / sum(1 / r for r in radii)
    if dim == 2:
        half = np.sqrt(4 * force * radius / (np.pi * stiffness))
        return problem, half, 2 * force / (np.pi * half)
    half = (3 * force * radius / (4 * stiffness)) ** (1 / 3)
    return problem, half, 3 * force / (2 * np.pi * half**2)


@pytest.mark.slow
def test_the_largest_pressure_of_equal_bodies_converges():
    """Of two equal bodies in 3D Hertz's largest pressure is 11 % too large with 4 cells along the radius of contact,
    and 2 % with 5 smaller ones: of the second order at least.
    """
    found = []
    for counts in (((9, 6), (7, 5)), ((14, 9), (11, 8))):
        problem, _, largest = pressed(3, counts, linear_algebra="krylov")
        found.append(problem.state.pressure.max() / largest - 1)
    assert abs(found[1]) < 0.03
    assert np.log(found[0] / abs(found[1])) / np.log(14 / 9) > 2


@pytest.mark.slow
@pytest.mark.parametrize(("dim", "counts"), [(2, ((24, 16), (20, 14))), (3, ((9, 6), (7, 5)))])
def test_ratios_of_stiffness(dim, counts, monkeypatch):
    """The other body 1000 times stiffer, either way, points on the softer one: Hertz's pressure, and about as many
    solves and Krylov steps as for equal ones; with friction the certificate holds too.
    """
    cycles, apply = [0], ContactPreconditioner.apply

    def counted(self, *arguments):
        cycles[0] += 1
        apply(self, *arguments)

    monkeypatch.setattr(ContactPreconditioner, "apply", counted)
    effort = {}
    for friction in (None, Coulomb(0.3)):
        for young in ((200.0, 200.0), (200.0, 2e5), (2e5, 200.0)):
            cycles[0] = 0
            slave = int(young[0] > young[1])
            problem, _, largest = pressed(dim, counts, young, slave=slave, friction=friction, linear_algebra="krylov")
            assert problem.certificate.holds
            solves = problem.history.linear_solves
            effort[friction, young] = solves, cycles[0] / solves
            if friction is None and young[0] != young[1]:
                assert problem.state.pressure.max() == pytest.approx(largest, rel=0.03)
    for (friction, _), (solves, steps) in effort.items():
        equal = effort[friction, (200.0, 200.0)]
        assert solves <= (1.2 if friction is None else 1.8) * equal[0]
        assert steps <= 1.6 * equal[1]


@pytest.mark.slow
def test_normals_of_both_sides():
    """Frictionless tractions are along normals half-way between both sides: on meshes that are mirror images it does
    not matter which side has the points, and of bodies of one radius R none has a part along x.  Along the normals of
    one side both differed by a / R of the largest pressure, on any mesh.
    """

    def tractions(count, scale, slave):
        shape = (count, 2 * count // 3)
        problem, half, largest = pressed(
            2, (shape, shape), radii=(8.0 * scale, 8.0 * scale), depth=0.05 / scale, slave=slave
        )
        boundary, state = problem.state.boundary, problem.state
        found = boundary.nodal_forces(state.pressure, state.shear) / boundary.weight[:, None]
        return (1 - 2 * slave) * found[np.argsort(boundary.x[:, 0])], half / (8.0 * scale), largest

    for count, scale in ((16, 1), (16, 4), (32, 1)):
        (one, share, largest), (other, *_) = (tractions(count, scale, slave) for slave in (0, 1))
        across, along = np.abs(one - other).max(axis=0) / largest
        assert across < 1e-4 * share
        assert along < 1e-7
        assert np.abs(one[:, 0]).max() < 1e-3 * share * largest
