"""What a scene in 3D may list, one by one: kinds of contact and friction, load steps, ways to solve
it.

Every scene is solved a second time with the tangents turned at random at every node: the same
counts, the same numbers.
"""

import basix.ufl
import numpy as np
import pytest
from dolfinx import fem
from dolfinx import mesh as dmesh
from mpi4py import MPI
from scenes import alone
from spaces import block, box, friction_of, turned_tangents

from signorini_fx.errors import SceneError
from signorini_fx.mechanics.contact_points import contact_boundary
from signorini_fx.mechanics.mesh.tagged import tag_boundaries
from signorini_fx.scenes.reading import parse_scene

OSCILLATING = "0.3 + 0.1 * sin(5 * x[0]) * cos(4 * x[1])"
CONTACT = {"boundary": "bottom", "gap": "0.003 * ((x[0] - 1.5)**2 + (x[1] - 0.5)**2) + 0.001"}


def changed(scene, **more):
    """The block with other tables, by way of the reader."""
    given = {
        name: getattr(scene, name)
        for name in ("mesh", "material", "displacement", "traction", "contact", "solver")
    }
    return parse_scene({**given, **more})


def contact(**friction):
    """The paraboloid with other friction."""
    return {"contact": {**CONTACT, "friction": friction}}


COULOMB = block(12, coefficient=0.3, gamma="auto")
SCENES = {
    "frictionless": block(12, gamma="auto"),
    "tresca": block(12, bound=1.5, gamma="auto"),
    "coulomb": COULOMB,
    "monolithic": block(12, coefficient=0.3, gamma="auto", coulomb="newton"),
    "much friction": block(12, coefficient=2.0, gamma="auto"),
    "tetrahedra": block(12, "tetrahedra", coefficient=0.3, gamma="auto"),
    "krylov": block(12, bound=1.5, gamma=1e7, linear_algebra="krylov"),
    "path-following": block(12, coefficient=0.3, gamma="auto", algorithm="path-following"),
    "alm": block(12, coefficient=0.3, gamma="auto", algorithm="alm"),
    "cap": changed(COULOMB, **contact(law="coulomb", coefficient=0.5, cap=2.0)),
    "varying F": changed(COULOMB, **contact(law="coulomb", coefficient=OSCILLATING)),
    "bilateral": changed(
        COULOMB, contact={**CONTACT, "kind": "bilateral", "friction": friction_of(coefficient=0.3)}
    ),
    "two boundaries": changed(
        COULOMB,
        contact=[
            {**CONTACT, "friction": friction_of(coefficient=0.3)},
            {"boundary": "back", "gap": 0.002, "friction": friction_of(bound=0.5)},
        ],
    ),
    "direction": changed(
        COULOMB,
        contact={
            **CONTACT,
            "direction": [0.1, -0.2, -1.0],
            "friction": friction_of(coefficient=0.3),
        },
    ),
    "near incompressibility": changed(
        COULOMB, material={"young": 5000.0, "poisson": 0.4999}, element={"volumetric": "reduced"}
    ),
    "load steps": changed(
        COULOMB,
        traction=[
            {"boundary": "top", "pressure": "20 if 1 <= x[0] <= 2 else 0"},
            {
                "boundary": "top",
                "y": "4 if 1 <= x[0] <= 2 else 0",
                "factors": [0.0, 1.0, 0.7, 0.0, -0.7],
            },
            {
                "boundary": "top",
                "x": "4 if 1 <= x[0] <= 2 else 0",
                "factors": [0.0, 0.0, 0.7, 1.0, 0.7],
            },
        ],
    ),
}
# On quadratic tetrahedra the contact points are averages: everything that may be asked of them once
# more.
AVERAGED = ("monolithic", "alm", "bilateral", "two boundaries", "direction", "load steps")
SCENES |= {
    f"quadratic tetrahedra, {name}": changed(
        SCENES[name], mesh=box("tetrahedra", (6, 2, 2)), element={"degree": 2}
    )
    for name in AVERAGED
}


def counts(solution):
    """What the iteration went through."""
    return [
        (r.outer, r.active_contact, r.slip_plus, r.changed) for r in solution.history.iterations
    ]


@pytest.mark.one_quick("name", SCENES)
def test_solved_whatever_the_tangents(name, monkeypatch):
    """It is solved, its certificate holds, and no number depends on the tangents that somebody
    chose.
    """
    solution = alone(SCENES[name])
    assert solution.certificate.holds
    rng = np.random.default_rng(3)
    monkeypatch.setattr(
        contact_boundary, "tangents_of", lambda normal: turned_tangents(normal, rng)
    )
    turned = alone(SCENES[name])
    assert not np.allclose(turned.contact.boundary.tangents, solution.contact.boundary.tangents)
    assert counts(turned) == counts(solution)
    ours, theirs = turned.table.columns, solution.table.columns
    for names in (
        ("u_n", "u_t", "u_t_x", "u_t_y", "u_t_z"),
        ("pressure", "shear", "shear_x", "shear_y", "shear_z"),
    ):
        # Round-off of the penalty, and what a loose linear solve leaves.
        share = 1e-7 if name == "krylov" else 1e-10
        size = max(np.abs(theirs[one]).max() for one in names)
        for one in names:
            np.testing.assert_allclose(
                ours[one], theirs[one], rtol=0, atol=share * size, err_msg=one
            )
    for one in ("state", "friction"):
        assert ours[one].tolist() == theirs[one].tolist()


def test_load_steps_have_a_history():
    """Slip takes work out of the body in every step but the first, never gives any; the path
    matters.
    """
    solution = alone(SCENES["load steps"])
    works = [step.contact.friction_work for step in solution.steps]
    assert min(works) >= -1e-12
    assert max(works[1:]) > 0
    steps = [step.contact.forces[1] for step in solution.steps]
    np.testing.assert_allclose(
        [step.contact.forces[0][2] for step in solution.steps], 20.0, rtol=1e-8
    )
    assert np.abs(steps[-1][0]) > 0


@pytest.mark.parametrize("coefficient", [1e5, 1e6])
def test_rigid_block_on_rough_ground(coefficient):
    """Everything that touches sticks, and statics does not take the largest friction for the only
    one.
    """
    scene = parse_scene(
        {
            "mesh": box("hexahedra", (4, 4, 2), size=(2.0, 2.0, 1.0)),
            "material": {"young": 1000.0, "poisson": 0.3},
            "traction": {"boundary": "top", "pressure": 10.0, "x": 8.0},
            "contact": {"boundary": "bottom", "friction": friction_of(coefficient=coefficient)},
        }
    )
    solution = alone(scene)
    assert solution.converged
    assert set(solution.table.columns["state"]) <= {"stick", "open"}


def test_curved_cells():
    """Hexahedra of the second order on a bowl: refused with linear elements, solved with quadratic
    ones.
    """
    straight = box("hexahedra", (4, 4, 2), size=(2.0, 2.0, 1.0)).mesh
    nodes = fem.functionspace(straight, ("Lagrange", 2))
    x = nodes.tabulate_dof_coordinates().copy()

    def bowl(x):
        return 0.2 * ((x[0] - 1) ** 2 + (x[1] - 1) ** 2)

    x[:, 2] += bowl(x.T) * (1 - x[:, 2])
    element = basix.ufl.element("Lagrange", "hexahedron", 2, shape=(3,))
    mesh = dmesh.create_mesh(MPI.COMM_SELF, nodes.dofmap.list.astype(np.int64), x=x, e=element)
    tagged = tag_boundaries(
        mesh,
        {
            "bottom": lambda x: np.abs(x[2] - bowl(x)) < 1e-9,
            "top": lambda x: np.abs(x[2] - 1) < 1e-9,
        },
    )

    def scene(degree):
        return parse_scene(
            {
                "mesh": tagged,
                "element": {"degree": degree},
                "material": {"young": 1000.0, "poisson": 0.3},
                "displacement": {"boundary": "top", "x": 0.01, "y": 0.005, "z": -0.05},
                "contact": {
                    "boundary": "bottom",
                    "gap": "x[2]",
                    "direction": [0.0, 0.0, -1.0],
                    "friction": friction_of(coefficient=0.3),
                },
            }
        )

    with pytest.raises(SceneError, match="curved cells"):
        alone(scene(1))
    solution = alone(scene(2))
    assert solution.certificate.holds
    assert {"slip", "open"} <= set(solution.table.columns["state"])
