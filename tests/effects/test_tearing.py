"""Bonds that tear, with the closed solutions of columns and blocks, and the beam theory of a double cantilever."""

import numpy as np
import pytest
from boxes import Box, boxes_mesh
from commands import run_python
from forms import box, hooke, side
from mpi4py import MPI
from numpy.testing import assert_allclose
from on_meshes import no_load, trial_and_test, vector_space
from parameters import slow
from scene_tables import rectangle_mesh

import signorini_fx as sfx
from signorini_fx.errors import SceneError

COLUMN = sfx.Cohesion(1.0, 0.05, stiffness=1e4)
PULLED = [0.05, 0.02, 0.05, -0.01, 0.1, 0.15]
STRESS = [0.5561735, 0.2224694, 0.5561735, -1.0, 0.0, 0.0]
MIXED = sfx.Cohesion(30.0, 0.3, shear_strength=50.0, shear_energy=0.9, exponent=2.1, stiffness=1e5)


def column(way, height=10.0, **changed):
    """A column without lateral strain that is bonded below, and whose top is moved."""
    given = {
        "mesh": rectangle_mesh(2, 2, length=1.0, height=height),
        "material": sfx.LinearElastic(young=1000.0, poisson=0.0),
        "displacement": [
            sfx.Displacement(boundary="top", y=1.0, factors=way),
            sfx.Displacement(boundary="left", x=0.0),
        ],
        "contact": sfx.Contact(boundary="bottom", cohesion=COLUMN),
    }
    return sfx.Scene(**given | changed)


@pytest.mark.parametrize("generator", ["rectangle", "box"])
def test_pulled_and_released(generator):
    """A column that nothing else holds sideways follows its bond, unloads along its secant,
    presses, and tears.
    """
    parameters = {"length": 1.0, "height": 10.0, "nx": 2, "ny": 2}
    up = "y"
    if generator == "box":
        parameters |= {"width": 1.0, "nz": 2}
        up = "z"
    moved = sfx.Displacement(boundary="top", **{up: 1.0}, factors=PULLED)
    mesh = {"generator": generator, "parameters": parameters}
    solution = sfx.solve(column(PULLED, mesh=mesh, displacement=moved), check=False)
    assert [step.status.name for step in solution.steps] == ["CONVERGED"] * 5 + ["NOT_HELD"]
    for step, stress in zip(solution.steps[:5], STRESS, strict=False):
        pressure = step.contact.pressure
        assert_allclose(pressure, -stress, rtol=2e-5, atol=1e-9)
    last = solution.steps[4].figures
    assert last["torn"] == pytest.approx(0.05, rel=1e-9)
    assert last["broken"] == pytest.approx(1.0)


@pytest.mark.parametrize("pair", [False, True])
def test_of_forms(pair):
    """Foundations and pairs of forms are torn as those of scenes."""
    if pair:
        halves = boxes_mesh(
            MPI.COMM_WORLD,
            [Box("lower", 0.0, 0.0, 1.0, 5.0, 2, 2), Box("upper", 0.0, 5.0, 1.0, 5.0, 3, 2)],
        )
        mesh = halves.mesh
        facets, other = halves.facets("bottom upper"), halves.facets("top lower")
        contact = sfx.Pair(facets, other, cohesion=COLUMN)
    else:
        mesh = box((1.0, 10.0), (2, 2))
        contact = sfx.Foundation(side(mesh, 1, 0.0), cohesion=COLUMN)
    from dolfinx import fem

    space = vector_space(mesh)
    top = fem.Constant(mesh, 0.0)
    bcs = []
    for axis, at, value in ((1, 10.0, top), (0, 0.0, 0.0)) + ((1, 0.0, 0.0),) * pair:
        sub = space.sub(axis)
        dofs = fem.locate_dofs_topological(sub, 1, side(mesh, 1 if axis else 0, at))
        bcs.append(fem.dirichletbc(value if value is top else fem.Constant(mesh, value), dofs, sub))
    u, v = trial_and_test(space)
    a = hooke(u, v, 1000.0, 0.0)
    problem = sfx.ContactProblem(a, no_load(mesh, v), bcs, contact)
    state = problem.initial()
    for number, (way, stress) in enumerate(zip(PULLED, STRESS, strict=True)):
        top.value = way
        state, result = problem.step(state, number + 1.0)
        assert result.status is sfx.Status.CONVERGED
        # Forces by mean: the sides of triangles do not share them evenly.
        force = result.contact.forces[0][1]
        assert force == pytest.approx(-stress, rel=2e-5, abs=1e-9)


def sheared(way, young=7e6, cells=8):
    """A block 20 x 5 on its bond, pressed by 20 and pushed."""
    parameters = {"length": 20.0, "height": 5.0, "nx": cells, "ny": cells // 4}
    return column(
        way,
        mesh=rectangle_mesh(**parameters),
        material=sfx.LinearElastic(young=young, poisson=0.0),
        displacement=sfx.Displacement(boundary="left", x=1.0, factors=way),
        traction=sfx.Traction(boundary="top", pressure=20.0),
        contact=sfx.Contact(boundary="bottom", friction=sfx.Coulomb(0.4), cohesion=MIXED),
    )


def test_pressed_and_sheared():
    """A block on rollers that is pushed over its bond rubs with Coulomb friction, and back."""
    solution = sfx.solve(sheared([0.02, 0.05, 0.12, 0.06]))
    first, last = 50.0 / 1e5, 2 * 0.9 / 50.0
    damage = last * (0.02 - first) / (0.02 * (last - first))
    shear = (1 - damage) * 1e5 * 0.02 + damage * 0.4 * 20.0
    # The body is stiff, not rigid.
    forces = [step.contact.forces[1][0] for step in solution.steps]
    assert_allclose(forces, [-20 * shear, -160.0, -160.0, 160.0], rtol=1e-2)
    assert forces[1:] == pytest.approx([-160.0, -160.0, 160.0], rel=1e-9)
    assert solution.steps[-1].figures["torn"] == pytest.approx(18.0, rel=1e-4)


def cantilever(facet, steps, strength, *, opening=8.0, energy=0.3, **changed):
    """Half of a double cantilever, whose opening is half of that of both, as are energies."""
    factors = list(np.linspace(opening / steps, opening, steps) / 2)
    parameters = {"length": 100.0, "height": 1.5, "nx": round(100 / facet), "ny": 2}
    parameters["cell"] = "quadrilateral"
    return sfx.Scene(
        mesh=rectangle_mesh(**parameters),
        material=sfx.LinearElastic(young=70_000.0, poisson=0.0, hypothesis="plane stress"),
        element=sfx.Element(degree=2),
        displacement=[
            sfx.Displacement(boundary="left", y=1.0, factors=factors),
            sfx.Displacement(boundary="right", x=0.0),
        ],
        contact=sfx.Contact(
            boundary="bottom",
            cohesion=sfx.Cohesion(f"where(x[0] > 29.999, {strength}, 0)", energy / 2),
        ),
    ).model_copy(update=changed)


def beam(opening, energy=0.3, young=70_000.0, height=1.5):
    """The force at an opening of both arms, whatever the root is."""
    c = np.sqrt(energy * young * height**3 / 12)
    return c * np.sqrt(8 * c / (young * height**3 * opening))


@pytest.mark.parametrize(("facet", "steps", "within"), [(2.0, 10, 0.03), slow(0.5, 80, 4e-3)])
def test_double_cantilever(facet, steps, within):
    """Its force is that of beam theory, and the energy to tear is that of the torn area."""
    solution = sfx.solve(cantilever(facet, steps, 10.0))
    assert solution.converged
    assert beam(np.array([4.0, 6.0, 8.0])) == pytest.approx([1.96026, 1.60054, 1.38611], rel=1e-5)
    openings = np.linspace(8.0 / steps, 8.0, steps)
    forces = np.array([-step.contact.forces[0][1] for step in solution.steps])
    away = (forces / beam(openings) - 1)[openings > 4]
    assert abs(away.mean()) < within
    last = solution.steps[-1]
    damage = last.contact.damage
    torn = last.contact.points.weight @ (damage >= 1.0) - 30.0
    zone = last.figures["process_zone"]
    assert 0.15 * (torn - facet) < last.figures["torn"] < 0.15 * (torn + zone + facet)


@pytest.mark.slow
def test_same_on_three_meshes():
    """What a mesh of one facet in the process zone, of two and of four say of peak and end."""
    told = []
    for facet in (1.0, 0.5, 0.25):
        solution = sfx.solve(cantilever(facet, 60, 10.0))
        forces = [-step.contact.forces[0][1] for step in solution.steps]
        told.append((max(forces), forces[-1], solution.steps[-1].figures["torn"]))
    for row in told[:2]:
        assert row == pytest.approx(told[2], rel=1e-2)


@pytest.mark.parametrize("algebra", ["auto", "full"])
def test_hinged_block(algebra):
    """A rigid block that turns about a point of its bond needs the moment of the law."""
    first, last, angles = 1e-4, 0.1, [0.05, 0.15, 0.4]
    parameters = {"length": 1.0, "height": 0.25, "nx": 40, "ny": 1}
    bond = {"strength": 1.0, "energy": 0.05, "stiffness": 1e4}
    solution = sfx.solve(
        column(
            angles,
            mesh=rectangle_mesh(**parameters),
            material=sfx.LinearElastic(young=1e9, poisson=0.0),
            displacement=[sfx.Displacement(boundary="top", x="-x[1]", y="x[0]", factors=angles)],
            contact=sfx.Contact(boundary="bottom", cohesion=bond),
            solver={"largest_deformation": 10.0, "linear_algebra": algebra},
        )
    )
    assert solution.converged
    for step, angle in zip(solution.steps, angles, strict=True):
        points = step.contact.boundary
        moment = -step.contact.pressure @ (points.weight * points.x[:, 0])
        y = min(angle, last)
        soft = last * (y**2 - first**2) / 2 - (y**3 - first**3) / 3
        exact = 1.0 / angle**2 * (first**2 / 3 + soft / (last - first))
        assert moment == pytest.approx(exact, rel=1e-2)
    assert exact == pytest.approx(0.010427, rel=1e-4)


def halves(count, *, length=100.0, height=1.5):
    """Two strips upon each other."""
    boxes = [
        Box(name, 0.0, y, length, height, count, 2)
        for name, y in (("lower", 0.0), ("upper", height))
    ]
    return boxes_mesh(MPI.COMM_WORLD, boxes)


@pytest.mark.slow
def test_end_notched_flexure():
    """Two arms that slide on each other before the bond tears in shear, by beam theory."""
    way = [-1.0, -2.0, -2.2]
    solution = sfx.solve(
        sfx.Scene(
            mesh=halves(50),
            material=sfx.LinearElastic(young=70_000.0, poisson=0.0, hypothesis="plane stress"),
            element=sfx.Element(degree=2),
            displacement=[
                sfx.Displacement(at=[0.0, 0.0], x=0.0, y=0.0),
                sfx.Displacement(at=[100.0, 0.0], y=0.0),
                sfx.Displacement(at=[50.0, 3.0], y=1.0, factors=way),
            ],
            contact=sfx.Contact(
                boundary="bottom upper",
                against="top lower",
                cohesion=sfx.Cohesion("where(x[0] > 34.999, 30, 0)", 0.3, shear_strength=50.0),
            ),
        )
    )
    forces = [solution.at(step).resultants.of("(50, 3)").force[1] for step in solution.steps]
    assert -forces[0] == pytest.approx(4.99175, rel=2e-3)
    reached = 35.0 + solution.steps[-1].figures["broken"]
    sharp = 4 / 3 * np.sqrt(0.3 * 70_000 * 1.5**3) / reached
    assert -forces[-1] == pytest.approx(sharp, rel=2e-2)


def test_stiff_and_strong():
    """A bond that never softens is ``bonded``."""
    blocks = boxes_mesh(
        MPI.COMM_WORLD,
        [Box("lower", 0.0, 0.0, 2.0, 1.0, 4, 2), Box("upper", 0.0, 1.0, 2.0, 1.0, 5, 2)],
    )
    ties = ({"kind": "bonded"}, {"cohesion": sfx.Cohesion(1e6, 1e9, stiffness=1e9)})
    moved = [
        sfx.solve(
            sfx.Scene(
                mesh=blocks,
                material=sfx.LinearElastic(young=1000.0, poisson=0.3),
                displacement=sfx.Displacement(boundary="bottom lower", x=0.0, y=0.0),
                traction=sfx.Traction(boundary="top upper", x=2.0, y=5.0),
                contact=sfx.Contact(boundary="bottom upper", against="top lower", **tie),
            )
        ).displacement.x.array
        for tie in ties
    ]
    assert_allclose(moved[1], moved[0], atol=1e-4 * np.abs(moved[0]).max())


@pytest.mark.parametrize(
    ("facet", "strength", "zone", "level"),
    [(1.0, 10.0, 2.17, "note"), (4.0, 30.0, 1.25, "warning")],
)
def test_told(facet, strength, zone, level):
    """``check`` compares facets with the process zone, ``solve`` tells what is broken and whether
    it breaks in jumps, and tables have damage and opening.
    """
    scene = cantilever(facet, 16, strength)
    solution = sfx.solve(scene)
    finding, *told = (f for f in solution.findings if f.path == "contact[0].cohesion")
    assert finding.level == level
    assert f"process zone of about {zone}" in finding.message
    assert any(" of 7" in each.message for each in told)
    (jumps,) = [each for each in told if "breaks in jumps" in each.message]
    assert jumps.level == level
    columns = solution.table.columns
    assert columns["damage"][0] == 1.0
    assert columns["opening"][0] == pytest.approx(4.0, rel=1e-2)
    assert columns["damage"][-1] == 0.0


def test_pulled_by_force():
    """Beyond the strength a force finds no equilibrium, and a ramp says up to which load."""
    held = sfx.Displacement(boundary="left", x=0.0)
    pulled = sfx.Traction(boundary="top", y=2.0)
    scene = column([0.0], displacement=held, traction=pulled, load_steps={"steps": 10})
    solution = sfx.solve(scene, check=False)
    assert solution.status is sfx.Status.OPEN
    assert "0.5 times traction[0]" in solution.advice


def test_soft_block():
    """A large step through the process zone leads somewhere: line searches ended at nothing."""
    solution = sfx.solve(sheared([0.02, 0.05], young=7e4, cells=20))
    assert solution.contact.forces[1][0] == pytest.approx(-160.0, rel=1e-9)
    assert solution.steps[1].linear_solves < 60
    assert not solution.history.events


def test_friction_of_what_is_broken():
    """Friction used is none of a body that bonds hold; what is broken transmits Coulomb's."""
    for way, limit in ((0.02, np.inf), (0.2, 160.0)):
        solution = sfx.solve(sheared([way]))
        (figures,) = solution.contact_figures
        assert figures.friction_limit == pytest.approx(limit)


BAD = {
    "energy": ({"energy": 0.0}, r"cohesion\.energy: must be above 0"),
    "strength": (
        {"strength": "-x[0]"},
        r"contact\[0\]\.cohesion\.strength: must be above 0 at all",
    ),
    "exponent": ({"shear_energy": 0.9}, "shear_energy: differs from energy: give exponent"),
    "softer": ({"stiffness": 9.0}, r"cohesion\.stiffness: must be above 10, or the bond"),
    "nowhere": ({"strength": 0.0}, r"contact\[0\]\.cohesion: bonds no point"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_bonds(name):
    """One error names the key."""
    changed, message = BAD[name]
    given = {"strength": 1.0, "energy": 0.05} | changed
    with pytest.raises(SceneError, match=message):
        sfx.solve(column([0.1], contact=sfx.Contact(boundary="bottom", cohesion=given)))


REFUSED = {
    "gap": ({"gap": 0.1}, {}, "bonds no point: the sides are 0.1 apart"),
    "kind": ({"kind": "bilateral"}, {}, "is for unilateral contact"),
    "tresca": ({"friction": sfx.Tresca(0.4)}, {}, "goes with Coulomb friction"),
    "wear": ({"wear": {"coefficient": 1e-6}}, {}, "is not possible yet with wear"),
    "moved": ({"gap": "0.01*t"}, {}, "is not possible yet where the foundation moves"),
    "inertia": ({}, {"inertia": {"time_step": 0.1}}, "is not possible yet with cohesion"),
    "metal": (
        {},
        {"material": {"law": "neo-hooke", "young": 1e3, "poisson": 0.3}},
        "is not possible yet with cohesion: it must be linear",
    ),
    "soft": ({"overclosure": {"stiffness": 1e3}}, {}, "is not possible with cohesion"),
    "alm": ({}, {"solver": {"algorithm": "alm"}}, "needs solver.algorithm = 'ssn'"),
    "levels": ({}, {"solver": {"levels": 2}}, "is not possible yet with cohesion"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_refused(name):
    """What does not go together is refused by name."""
    of_contact, of_scene, message = REFUSED[name]
    contact = {"boundary": "bottom", "cohesion": COLUMN} | of_contact
    with pytest.raises(SceneError, match=message):
        sfx.solve(column([0.1], contact=[sfx.Contact(**contact)], **of_scene))


def test_nothing_without_bonds():
    """Scenes without bonds import nothing of them."""
    program = (
        "import sys, signorini_fx as sfx\n"
        "block = {'generator': 'rectangle', 'parameters': {'nx': 2, 'ny': 2}}\n"
        "pressed = sfx.Traction(boundary='top', pressure=1.0)\n"
        "left = sfx.Displacement(boundary='left', x=0.0)\n"
        "sfx.solve(sfx.Scene(mesh=block, material=sfx.LinearElastic(young=1000.0, poisson=0.0),\n"
        "    traction=pressed, displacement=left, contact=sfx.Contact(boundary='bottom')))\n"
        "print([m for m in sys.modules if 'cohesion' in m or 'softening' in m or 'bond' in m])\n"
    )
    found = run_python(program)
    assert found.stdout.splitlines()[-1] == "[]"
