"""The certificate believes nothing of the solver: wrong answers of every kind, and faults put into
the solver.
"""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from certifying import certify
from mpi4py import MPI
from on_meshes import corners_of_cells
from scene_tables import coulomb_friction, fixed, rectangle_mesh, tresca_friction
from scenes import alone, example1, stack_of_three, table_of

from signorini_fx.algebra.algorithms.ssn import SemismoothNewton
from signorini_fx.mechanics.effects.displacement import Displacement
from signorini_fx.mechanics.mesh.refinement import refine
from signorini_fx.mechanics.model import Model
from signorini_fx.records import Status
from signorini_fx.results.certificate.contact_nodes import Law, Tractions
from signorini_fx.scenes.mesh import load_mesh
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.solving import solve_on_mesh
from signorini_fx.tuned import CERTIFICATE_TOLERANCE


def wedge(**solver):
    """A wedge in a groove whose flanks are oblique, held sideways at its top: two contact nodes
    have a support.
    """
    return parse_scene(
        {
            "mesh": {"generator": "wedge", "parameters": {"nx": 6, "ny": 12}},
            "material": {"young": 5000.0, "poisson": 0.3},
            "displacement": [fixed("top", "x")],
            "traction": [{"boundary": "top", "y": -20.0}],
            "contact": [
                {"boundary": side, "friction": coulomb_friction(0.2)} for side in ("left", "right")
            ],
            "solver": solver,
        }
    )


SCENES = {
    "no friction": lambda **s: example1(nx=30, ny=10, gamma="auto", **s),
    "Tresca": lambda **s: example1(bound=1.5, nx=30, ny=10, gamma="auto", **s),
    "Coulomb": lambda **s: example1(coefficient=0.3, nx=30, ny=10, gamma="auto", **s),
    "Coulomb, degree 2": lambda **s: example1(
        coefficient=0.3, nx=15, ny=5, degree=2, gamma="auto", **s
    ),
    "wedge": wedge,
}
METHODS = ("ssn", "alm")


@cache
def solved(name, algorithm):
    """A solution, with its certificate."""
    scene = SCENES[name](algorithm=algorithm)
    solution = alone(scene)
    assert solution.certificate.holds
    return solution


def judged(solution, displacement=None, statement=None, **changes):
    """The certificate of a solution with another displacement, other tractions, or of another
    scene.
    """
    moved = solution.displacement.copy()
    if displacement is not None:
        moved.x.array[:] = displacement(moved.x.array.copy())
    tractions = Tractions.of(solution.contact)
    for name, change in changes.items():
        tractions = replace(tractions, **{name: change(getattr(tractions, name).copy())})
    tagged = solution.model.tagged
    of = {"law": solution.certificate.law}
    return certify(statement or solution.statement, tagged, moved, tractions, **of)


def refused(certificate, *figures):
    """It does not hold, and these figures say why."""
    assert not certificate.holds
    for figure in figures:
        assert getattr(certificate, figure) > CERTIFICATE_TOLERANCE, figure


def at(row, change):
    """Change one entry of an array."""

    def changed(values):
        values[row] = change(values[row])
        return values

    return changed


PAIRS = [(name, algorithm) for name in SCENES for algorithm in METHODS]
each = pytest.mark.parametrize(("name", "algorithm"), PAIRS)
by = pytest.mark.parametrize("algorithm", METHODS)


@pytest.mark.slow
@each
def test_wrong_displacements(name, algorithm):
    """Scaled, turned, moved, one degree of freedom off by a thousandth, one off by a few
    millionths: none passes.
    """
    solution = solved(name, algorithm)
    x = solution.model.space.tabulate_dof_coordinates()
    largest = np.abs(solution.displacement.x.array).max()
    rng = np.random.default_rng(0)
    refused(judged(solution, lambda u: 1.2 * u))
    refused(judged(solution, lambda u: 0.8 * u))
    refused(judged(solution, lambda u: (1 + 1e-4) * u))
    refused(
        judged(
            solution, lambda u: u + 1e-4 * largest * np.column_stack((-x[:, 1], x[:, 0])).ravel()
        )
    )
    refused(judged(solution, lambda u: u + 1e-3 * largest * np.tile([0.0, 1.0], u.size // 2)))
    for dof in rng.integers(0, 2 * len(x), 40):
        refused(judged(solution, at(dof, lambda value: value + 1e-3 * largest)))
        refused(judged(solution, at(dof, lambda value: value - 5e-6 * largest)))


@pytest.mark.parametrize("algorithm", METHODS)
def test_one_node_of_many(algorithm):
    """A wrong pressure that is lost among the forces on all nodes is seen at its own."""
    solution = solved("Coulomb", algorithm)
    pressure = solution.contact.pressure
    row = int(np.argmax(pressure))
    certificate = judged(
        solution, pressure=at(row, lambda value: (1 + 2 * CERTIFICATE_TOLERANCE) * value)
    )
    refused(certificate, "equilibrium")


KINDS = {
    "shear the other way": (
        {"shear": lambda c: -Tractions.of(c).shear},
        ("equilibrium", "wrong_way_slip"),
    ),
    "no shear": ({"shear": lambda c: 0 * Tractions.of(c).shear}, ("equilibrium",)),
    "beyond the bound": (
        {"shear": lambda c: Tractions.of(c).shear + 0.1 * c.pressure.max()},
        ("friction_cone",),
    ),
    "tension": (
        {"pressure": lambda c: c.pressure - 0.1 * c.pressure.max()},
        ("negative_pressure",),
    ),
    "pressure without contact": (
        {"pressure": lambda c: c.pressure + 0.01 * c.pressure.max()},
        ("equilibrium",),
    ),
}


@pytest.mark.one_quick("kind", KINDS)
@pytest.mark.parametrize(
    ("name", "algorithm"), [pair for pair in PAIRS if pair[0] in ("Coulomb", "Tresca", "wedge")]
)
def test_kinds_of_wrong_tractions(kind, name, algorithm):
    """Each violation has its figure."""
    solution = solved(name, algorithm)
    changes, figures = KINDS[kind]
    values = {key: change(solution.contact) for key, change in changes.items()}
    refused(
        judged(solution, **{key: lambda _, value=value: value for key, value in values.items()}),
        *figures,
    )


@pytest.mark.parametrize("push", [0.0, 1e-3])
@pytest.mark.parametrize("gamma", [1e1, 1e11])
def test_nodes_held_inside_with_a_tangent_free(gamma, push):
    """Supports hold all nodes inside the foundation and leave one tangential direction free, in
    which the normals have a component of round-off: loads and shear along this direction are
    judged, and a pressure is refused.
    """
    scene = parse_scene(
        {
            "mesh": {
                "generator": "ring",
                "parameters": {
                    "radius": 1.0,
                    "inner_radius": 0.5,
                    "height": 0.7,
                    "nt": 3,
                    "nr": 1,
                    "nz": 2,
                }
                | {"cell": "tetrahedron"},
            },
            "material": {"young": 1000.0, "poisson": 0.3},
            "displacement": [fixed(name, "xz") for name in ("outer", "inner")],
            "traction": {"boundary": "top", "x": -0.1, "y": push, "z": 0.1},
            "contact": {
                "boundary": "bottom",
                "gap": "1e-3*(x[0] + 0.3*x[1])",
                "friction": tresca_friction(0.1),
            },
            "solver": {"gamma_n": gamma, "gamma_t": gamma},
        }
    )
    solution = alone(scene)
    assert solution.certificate.holds
    assert not solution.contact.pressure.any()
    change = np.array([0.0, 1e-5, 0.0])
    refused(judged(solution, shear=lambda shear: shear + change), "equilibrium")
    refused(judged(solution, pressure=lambda pressure: pressure + 1e-5), "pressure_at_distance")
    load = scene.traction[0].model_copy(update={"y": push + 1e-5})
    refused(judged(solution, statement=scene.statement.changed(traction=(load,))), "equilibrium")


def test_another_scene():
    """Another load, support, material or load factor."""
    solution = solved("Coulomb", "ssn")
    scene = solution.statement
    load, support, material = scene.effects["traction"][0], scene.displacement[0], scene.material[0]
    others = {
        "traction": (load.model_copy(update={"x": 1e-3}),),
        "material": (material.model_copy(update={"poisson": 0.4001}),),
    }
    for key, value in others.items():
        refused(judged(solution, statement=scene.changed(**{key: value})), "equilibrium")
    pulled = scene.changed(
        displacement=(support.model_copy(update={"x": 1e-6}), scene.displacement[1])
    )
    refused(judged(solution, statement=pulled), "supports")


def test_the_law_itself_does_not_allow_for_gamma():
    """A regularised solution is none of the unregularised law: penetration and elastic slip refuse
    it.
    """
    solution = alone(example1(coefficient=0.6, nx=30, ny=10, gamma=1e6))
    assert solution.certificate.law == Law(1e6, 1e6)
    contact, tagged = solution.contact, solution.model.tagged
    certificate = certify(solution.statement, tagged, solution.displacement, Tractions.of(contact))
    refused(certificate, "entered", "slip_below_bound")
    half = certify(
        solution.statement, tagged, solution.displacement, Tractions.of(contact), law=Law(2e6, 2e6)
    )
    refused(half, "entered", "slip_below_bound")


def test_a_body_that_sinks_unhindered_is_refused():
    """The linear solution goes through the foundation, in equilibrium and with multipliers that
    violate nothing.
    """
    scene = example1(nx=60, ny=20)
    clamped = tuple(support.model_copy(update={"y": 0.0}) for support in scene.displacement)
    scene = scene.model_copy(update={"displacement": clamped})
    contact = alone(scene).contact
    free = alone(scene.model_copy(update={"contact": ()}))
    nothing = replace(
        Tractions.of(contact), pressure=0 * contact.pressure, shear=0 * Tractions.of(contact).shear
    )
    certificate = certify(scene.statement, free.model.tagged, free.displacement, nothing)
    assert (
        max(certificate.equilibrium, certificate.negative_pressure, certificate.friction_cone)
        < 1e-6
    )
    assert certificate.entered > 0.1
    assert not certificate.holds


@pytest.mark.parametrize("offset", [1e-4, -1e-4])
@pytest.mark.parametrize("algorithm", METHODS)
def test_bilateral_contact_where_a_support_holds_a_node(algorithm, offset):
    """The corner of a clamped side cannot follow bilateral contact with a gap: all other nodes do,
    and one more that does not is noticed.
    """
    scene = parse_scene(
        {
            "mesh": rectangle_mesh(8, 4, length=2.0),
            "material": {"young": 1000.0, "poisson": 0.3},
            "displacement": fixed("left"),
            "contact": {"boundary": "bottom", "kind": "bilateral", "gap": offset},
            "solver": {"algorithm": algorithm},
        }
    )
    solution = alone(scene)
    assert solution.certificate.holds
    columns = table_of(solution).columns
    u_n, pressure = columns["u_n"], columns["pressure"]
    assert u_n[0] == 0
    assert u_n[1:] - pressure[1:] / solution.certificate.law.gamma_n == pytest.approx(
        offset, rel=1e-9
    )
    for change in (1e-3 * offset, -1e-3 * offset):
        other = scene.contact[0].model_copy(update={"gap": offset + change})
        refused(judged(solution, statement=scene.statement.changed(contact=(other,))), "entered")


# --- faults in the solver -------------------------------------------------------------------------


def without_rotation(rest):
    """The reference motion without its rotation."""
    return rest and replace(rest, motion=rest.motion * [1, 1, 0])


def without_reference_motion(right):
    """The displacement counted from the reference motion is taken for the whole one."""
    return lambda discretisation, rest, displacement: right(discretisation, None, displacement)


def with_turned_rest(right):
    """The rotation of the reference motion is dropped from the displacement that the user gets."""
    return lambda discretisation, rest, displacement: right(
        discretisation, without_rotation(rest), displacement
    )


def stiffer(right):
    """One diagonal entry of the assembled matrix is a tenth of a per cent too large."""

    def spoilt(*arguments):
        found = right(*arguments)
        stiffness = found.stiffness
        row = stiffness.getSize()[0] // 2
        value = stiffness.getValue(row, row)
        stiffness.setValue(row, row, 1.001 * value)
        stiffness.assemble()
        return found

    return spoilt


def heavier(right):
    """Loads are a thousandth too large."""

    def spoilt(*arguments):
        found = right(*arguments)
        for case in found.cases:
            case.load.scale(1.001)
        return found

    return spoilt


def at_one_node(amount):
    """Add something to the value of a node in the middle."""

    def changed(values):
        values = values.copy()
        values[len(values) // 2] += amount * np.abs(values).max()
        return values

    return changed


def unmoved(right):
    """Contact state of an iterate that is not the displacement: the pressure of one node is off."""

    def spoilt(*arguments):
        pressure, shear = right(*arguments)
        return at_one_node(1e-4)(pressure), shear

    return spoilt


FAULTS = {
    "no reference motion": (Model, "from_rest", without_reference_motion),
    "rotation dropped": (Model, "from_rest", with_turned_rest),
    "wrong row of the stiffness": (solve_on_mesh, "prepare", stiffer),
    "wrong load": (solve_on_mesh, "prepare", heavier),
    "wrong pressure": (SemismoothNewton, "multipliers", unmoved),
}


@pytest.mark.one_quick("fault", FAULTS)
@by
def test_faults_of_the_solver_are_refused(monkeypatch, fault, algorithm):
    """Whatever the solver gets wrong by itself: no result that is called converged."""
    scene = on_a_slope(algorithm=algorithm, fallbacks=False)
    assert alone(scene).converged
    module, name, wrong = FAULTS[fault]
    monkeypatch.setattr(module, name, wrong(getattr(module, name)))
    solution = alone(scene, check=False)
    assert not solution.converged
    assert fault == "wrong pressure" or solution.status is Status.NOT_CERTIFIED


def on_a_slope(**solver):
    """A block that falls onto a slope and turns until it lies on it, where friction alone holds
    it.
    """
    return parse_scene(
        {
            "mesh": rectangle_mesh(20, 8),
            "material": {"young": 5000.0, "poisson": 0.3},
            "traction": [{"boundary": "top", "y": -20.0, "x": 1.0}],
            "contact": {
                "boundary": "bottom",
                "gap": "0.02 + 0.03*x[0] + 1e-4*(x[0] - 1.5)**2",
                "friction": coulomb_friction(0.2),
            },
            "solver": solver,
        }
    )


def test_a_rigid_motion_is_no_deformation():
    """Lengths are judged by the deformation: a body that turns far has no leave to enter its
    foundation farther.
    """
    solution = alone(on_a_slope())
    x = solution.model.space.tabulate_dof_coordinates()[:, :2]
    u = solution.displacement.x.array
    motions = np.zeros((u.size, 3))
    motions[::2, 0] = motions[1::2, 1] = 1.0
    motions[::2, 2], motions[1::2, 2] = -x[:, 1], x[:, 0]
    left = np.linalg.norm(
        (u - motions @ np.linalg.lstsq(motions, u)[0]).reshape(-1, 2), axis=1
    ).max()
    assert left < 0.1 * np.abs(u).max()
    effect = solution.statement.contact[0]
    gap = lambda x: effect.gap(x) - 3 * CERTIFICATE_TOLERANCE * left  # noqa: E731
    scene = solution.statement.changed(contact=(effect.model_copy(update={"gap": gap}),))
    refused(judged(solution, statement=scene), "entered")


@pytest.mark.one_quick(("size", "stress"), [(1.0, 1.0), (1e-6, 1e9)])
def test_a_body_that_moves_far_does_not_deform_another_one(size, stress):
    """Two blocks move by half of their size until a third one deforms them by a thousandth of that:
    a gap that is wrong by a share of what deforms them is not right because they have moved far.
    """
    friction = coulomb_friction(0.5)
    solution = alone(stack_of_three(-0.5005, friction, friction, gap=0.5, size=size, stress=stress))
    assert solution.certificate.holds
    x = solution.model.space.tabulate_dof_coordinates()[:, :2]
    u = solution.displacement.x.array.reshape(-1, 2)
    down = u[:, 1] < -0.25 * size
    left = 0.0
    for body in (down, ~down):
        motions = np.zeros((np.count_nonzero(body), 2, 3))
        motions[:, 0, 0] = motions[:, 1, 1] = size
        motions[:, 0, 2], motions[:, 1, 2] = -x[body, 1], x[body, 0]
        flat = motions.reshape(-1, 3)
        rest = u[body].ravel() - flat @ np.linalg.lstsq(flat, u[body].ravel())[0]
        left = max(left, np.linalg.norm(rest.reshape(-1, 2), axis=1).max())
    assert left < 1e-3 * size
    contact = solution.statement.contact
    for error, figure in ((3, "entered"), (-3, "pressure_at_distance")):
        gap = 0.5 * size - error * CERTIFICATE_TOLERANCE * left
        scene = solution.statement.changed(
            contact=(contact[0].model_copy(update={"gap": gap}), contact[1])
        )
        refused(judged(solution, statement=scene), figure)


def test_a_node_smaller_than_the_digits_of_the_displacement():
    """Halved thirty times at a corner in contact, facets are 1e-9 long: no round-off is taken for a
    stress there.
    """
    scene = example1(bound=1.5, nx=6, ny=2, cell="triangle", degree=2)
    scene = scene.model_copy(
        update={
            "displacement": (Displacement(boundary="top", x=0.001, y=-0.01),),
            "traction": (),
            "contact": tuple(effect.model_copy(update={"gap": 0.0}) for effect in scene.contact),
        }
    )
    tagged = load_mesh(scene, MPI.COMM_SELF)
    for _ in range(30):
        x = corners_of_cells(tagged)
        at_corner = (np.abs(x).max(axis=2) == 0.0).any(axis=1)
        tagged = refine(tagged, np.flatnonzero(at_corner).astype(np.int32))
    solution = alone(scene.model_copy(update={"mesh": tagged}))
    assert solution.contact.boundary.weight.min() < 1e-9
    assert solution.certificate.equilibrium < 1e-9
