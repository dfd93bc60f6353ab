"""Scenes that several tests share, as plain functions."""

from __future__ import annotations

import itertools
import tomllib

import numpy as np
from mpi4py import MPI
from numpy.testing import assert_allclose, assert_array_equal
from scene_tables import coulomb_friction, fixed, rectangle_mesh, tresca_friction

from signorini_fx.mechanics.body.discretisation import prepare
from signorini_fx.mechanics.contact_points.contact_table import contact_table
from signorini_fx.mechanics.mesh.tagged import generate_mesh, gmsh_mesh
from signorini_fx.records import Status, Timings
from signorini_fx.scenes.mesh import load_mesh
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.solver import solve

PATCH = "1.25 <= x[0] <= 1.75"


def example1(
    *,
    poisson=0.4,
    bound=None,
    coefficient=None,
    gamma=1e8,
    nx=120,
    ny=40,
    cell="quadrilateral",
    generator="rectangle",
    degree=1,
    patch="all",
    layout=None,
    length_unit=1.0,
    stress_unit=1.0,
    **settings,
):
    """Example 1 of section 7.1: Tresca friction with ``bound``, Coulomb friction with
    ``coefficient``, or none.

    ``gamma`` is one number, the pair (gamma_1, gamma_2), or "auto"; ``length_unit`` and
    ``stress_unit`` are what one unit of the paper measures in the units of the scene; ``settings``
    go to the solver, in the units of the scene.
    """
    length, stress = length_unit, stress_unit
    gamma_n, gamma_t = gamma if isinstance(gamma, tuple) else (gamma, gamma)
    solver = {"gamma_n": gamma_n, "gamma_t": gamma_t, "initial_contact": patch, **settings}
    if gamma != "auto":
        solver |= {"gamma_n": gamma_n * stress / length, "gamma_t": gamma_t * stress / length}
    parameters = {"length": 3.0 * length, "height": length, "nx": nx, "ny": ny, "cell": cell}
    if layout is not None:
        parameters["layout"] = layout
    friction = {"law": "none"}
    if bound is not None:
        friction = tresca_friction(bound * stress)
    if coefficient is not None:
        friction = coulomb_friction(coefficient)
    return parse_scene(
        {
            "mesh": {"generator": generator, "parameters": parameters},
            "element": {"degree": degree},
            "material": {"young": 5000.0 * stress, "poisson": poisson},
            "displacement": [fixed("left", "x"), fixed("right", "x")],
            "traction": {
                "boundary": "top",
                "y": f"{-20 * stress} if 1 <= x[0] / {length} <= 2 else 0",
            },
            "contact": {
                "boundary": "bottom",
                "gap": f"{length} * (0.003 * (x[0] / {length} - 1.5)**2 + 0.001)",
                "friction": friction,
            },
            "solver": solver,
        }
    )


def bar_on_a_bowl(nx, law, start):
    """A bar that only contact with a curved foundation holds, with Coulomb or Tresca friction."""
    return parse_scene(
        {
            "mesh": rectangle_mesh(nx, 4, length=1.0, height=0.1),
            "material": {"young": 1000.0, "poisson": 0.3},
            "traction": {"boundary": "top", "x": 0.05, "y": "-1 - x[0]"},
            "contact": {
                "boundary": "bottom",
                "gap": "0.01 + 0.02 * (x[0] - 0.4)**2",
                "friction": {"law": law}
                | ({"coefficient": 0.3} if law == "coulomb" else {"bound": 0.5}),
            },
            "solver": {"linear_algebra": "condensed", "initial_contact": start},
        }
    )


def draw_triangle(gmsh):
    """One cell with a free node, and sides of contact and support."""
    geo = gmsh.model.geo
    corners = [
        geo.addPoint(x, y, 0.0) for x, y in ((0.0, 0.0), (1.0, 0.0), (1.0 + np.sqrt(3.0), 1.0))
    ]
    lines = [geo.addLine(*ends) for ends in itertools.pairwise([*corners, corners[0]])]
    for line in lines:
        geo.mesh.setTransfiniteCurve(line, 2)
    body = geo.addPlaneSurface([geo.addCurveLoop(lines)])
    geo.mesh.setTransfiniteSurface(body)
    geo.synchronize()
    gmsh.model.addPhysicalGroup(2, [body], name="body")
    for name, line in zip(("contact", "support"), lines, strict=False):
        gmsh.model.addPhysicalGroup(1, [line], name=name)
    gmsh.model.mesh.generate(2)


def one_triangle(coefficient, force, **solver):
    """One linear triangle with one free node, whose stiffness is known."""
    return parse_scene(
        {
            "mesh": gmsh_mesh(MPI.COMM_SELF, draw_triangle, name="triangle"),
            "material": {"young": 2.5, "poisson": 0.25},
            "displacement": fixed("support"),
            "body_force": {"x": force[0], "y": force[1]},
            "contact": {"boundary": "contact", "friction": coulomb_friction(coefficient)},
            "solver": solver,
        }
    )


def changed(text, **entries):
    """The scene of a text with other entries, None: without them."""
    tables = {**tomllib.loads(text), **entries}
    return parse_scene({key: entry for key, entry in tables.items() if entry is not None})


def on_mesh(scene, tagged):
    """The same scene on a mesh of one's own."""
    return scene.model_copy(update={"mesh": tagged})


def alone(scene, **options):
    """Solve on this rank only, whatever the number of ranks."""
    return solve(scene, MPI.COMM_SELF, **options)


def rectangle(comm=MPI.COMM_SELF, **parameters):
    """The mesh of the generator ``rectangle``."""
    return generate_mesh("rectangle", parameters, comm)


def prepared(scene):
    """The scene on its mesh, before it is solved."""
    return prepare(scene.statement, load_mesh(scene, MPI.COMM_SELF), Timings())


def energy(solution):
    """a(y, y) / 2 of the last load step."""
    return solution.steps[-1].strain_energy


def table_of(solution):
    """The contact nodes as a table, in order along the boundary."""
    return contact_table(
        solution.contact, [effect.boundary for effect in solution.statement.contact]
    )


def same_answer(ours, theirs, share=1e-8):
    """Status, sets, displacement and tractions of two solutions of one rank."""
    assert ours.status is theirs.status is Status.CONVERGED
    assert ours.certificate.holds
    wanted = theirs.displacement.x.array
    assert_allclose(ours.displacement.x.array, wanted, rtol=0, atol=share * np.abs(wanted).max())
    found, wanted = ours.contact, theirs.contact
    assert_array_equal(found.in_contact, wanted.in_contact)
    size = max(np.abs(wanted.pressure).max(), np.abs(wanted.shear).max())
    for name in ("pressure", "shear"):
        assert_allclose(
            getattr(found, name), getattr(wanted, name), rtol=0, atol=share * size, err_msg=name
        )


def stack_of_three(lift, below, above, gap=0.0, size=1.0, stress=1.0, **solver):
    """Three blocks of the height ``size``, the lower one held at its bottom, the upper one moved by
    its top.

    Args:
        lift: of the top, in ``size``.
        below: friction below the middle block.
        above: friction above it.
        gap: below it, in ``size``; negative: an interference.
        size: a length.
        stress: Young's modulus is 100 times that.
        solver: its settings.
    """
    bodies = []
    for k, (name, cells) in enumerate((("lower", 3), ("middle", 2), ("upper", 3))):
        parameters = {
            "length": size,
            "height": size,
            "nx": cells,
            "ny": cells,
            "cell": "quadrilateral",
        }
        mesh = rectangle_mesh(**parameters)
        bodies.append({"name": name, "mesh": mesh, "shift": [0.0, k * size]})

    def friction(law):
        return law | ({"bound": law["bound"] * stress} if "bound" in law else {})

    moved = {"boundary": "upper.top", "x": 0.0, "y": lift * size}
    contact = {
        "boundary": "middle.bottom",
        "against": "lower.top",
        "gap": gap * size,
        "friction": friction(below),
    }
    return parse_scene(
        {
            "body": bodies,
            "material": {"young": 100.0 * stress, "poisson": 0.3},
            "displacement": [fixed("lower.bottom"), moved],
            "contact": [
                contact,
                {"boundary": "upper.bottom", "against": "middle.top", "friction": friction(above)},
            ],
            "solver": solver,
        }
    )
