"""A rubber O-ring between two plates: the mixed element against displacements alone, against Hertz,
and at finite strains against Lindley.
"""

from functools import cache

import numpy as np
import pytest
from mpi4py import MPI
from scenes import alone

from signorini_fx.mechanics.mesh.tagged import gmsh_mesh
from signorini_fx.scenes.reading import parse_scene

COMM = MPI.COMM_SELF
YOUNG, RADIUS, MIDDLE, SQUEEZE = 5.0, 1.0, 8.0, 0.05


def upper_half(size=0.04):
    """Half of the section, with curved cells that are small where it is pressed."""

    def draw(gmsh):
        geo = gmsh.model.geo
        centre, top = geo.addPoint(MIDDLE, 0, 0, 0.2), geo.addPoint(MIDDLE, RADIUS, 0, size)
        right, left = (geo.addPoint(MIDDLE + side * RADIUS, 0, 0, 0.2) for side in (1, -1))
        arcs = [geo.addCircleArc(right, centre, top), geo.addCircleArc(top, centre, left)]
        middle = [geo.addLine(left, centre), geo.addLine(centre, right)]
        geo.addPlaneSurface([geo.addCurveLoop([*arcs, *middle])])
        geo.synchronize()
        for name, curves in (("arc", arcs), ("middle", middle)):
            gmsh.model.setPhysicalName(1, gmsh.model.addPhysicalGroup(1, curves), name)
        gmsh.model.setPhysicalName(2, gmsh.model.addPhysicalGroup(2, [1]), "ring")
        gmsh.model.mesh.generate(2)
        gmsh.model.mesh.setOrder(2)

    return gmsh_mesh(COMM, draw, "ring")


def pressed(mesh, poisson, volumetric):
    """Both plates come closer by 5 % of the diameter of the section."""
    plate = {"shape": "plane", "point": [MIDDLE, RADIUS * (1 - SQUEEZE)], "normal": [0.0, -1.0]}
    scene = {
        "mesh": mesh,
        "element": {"degree": 2, "volumetric": volumetric},
        "material": {"young": YOUNG, "poisson": poisson, "hypothesis": "axisymmetric"},
        "displacement": {"boundary": "middle", "y": 0.0},
        "contact": {"boundary": "arc", "foundation": plate},
        "solver": {"algorithm": "alm"},
    }
    solution = alone(parse_scene(scene))
    columns = solution.table.columns
    return (
        solution,
        columns["x"] - MIDDLE,
        columns["pressure"],
        columns["weight"] * columns["pressure"],
    )


@cache
def ring(name):
    """One of three rings."""
    cases = {
        "displacement": (0.49, "full"),
        "mixed": (0.49, "mixed"),
        "incompressible": (0.5, "mixed"),
    }
    return pressed(upper_half(), *cases[name])


@pytest.mark.slow
def test_mixed_and_displacement():
    """At nu = 0.49: force, largest pressure, and the smallest principal stress, in each cell as it
    is.
    """
    one, other = ring("displacement"), ring("mixed")
    assert one[0].certificate.holds
    assert other[0].certificate.holds
    assert np.isclose(one[3].sum(), other[3].sum(), rtol=2e-3)
    assert np.isclose(one[2].max(), other[2].max(), rtol=0.02)
    assert ring("incompressible")[3].sum() > other[3].sum()
    # Below the contact the body is nearly under its pressure alone, which displacements alone miss
    # in single cells.
    missed = [abs(ring[0].stress.smallest().value / ring[2].max() + 1) for ring in (one, other)]
    assert missed[1] < 0.02
    assert 0.05 < missed[0] < 0.3


@pytest.mark.one_quick(("name", "poisson"), [("incompressible", 0.5), ("mixed", 0.49)])
def test_hertz(name, poisson):
    """A long cylinder under the same force per length; its contact is small against its radius."""
    _, x, pressure, forces = ring(name)
    load = forces.sum() / (2 * np.pi * MIDDLE)
    half_width = np.sqrt(4 * load * RADIUS / (np.pi * YOUNG / (1 - poisson**2)))
    assert np.isclose(2 * np.sqrt((forces @ x**2) / forces.sum()), half_width, rtol=0.015)
    assert np.isclose(pressure.max(), 2 * load / (np.pi * half_width), rtol=0.015)


@pytest.mark.slow
@pytest.mark.parametrize("coefficient", [0.0, 0.1])
def test_lindley(coefficient):
    """F / (pi D d E) = 1.25 C^1.5 + 50 C^6 (P. B. Lindley, J. Inst. Rubber Ind. 1 (1967) 209-213),
    a fit from 10 % on.  A smooth ring grows wider until nothing pulls around its axis; friction of
    more than d / 2 D holds it, so that its section is in plane strain and 4/3 as stiff.
    """
    plate = {
        "shape": "plane",
        "point": [MIDDLE, RADIUS],
        "normal": [0.0, -1.0],
        "shift": [0.0, "-t"],
    }
    contact = {"boundary": "arc", "foundation": plate}
    if coefficient:
        contact["friction"] = {"law": "coulomb", "coefficient": coefficient}
    scene = {
        "mesh": upper_half(0.08),
        "element": {"degree": 2, "volumetric": "auto"},
        "material": {"law": "neo-hooke", "isochoric": True, "young": YOUNG, "poisson": 0.4995}
        | {"hypothesis": "axisymmetric"},
        "displacement": {"boundary": "middle", "y": 0.0},
        "contact": contact,
        "load_steps": {"times": [0.05, 0.1, 0.15, 0.2, 0.25]},
    }
    solution = alone(parse_scene(scene))
    assert solution.findings == ()
    squeeze = np.array([step.time for step in solution.steps])
    forces = [-step.contact.forces[0][1] for step in solution.steps]
    load = np.array(forces) / (2 * np.pi * MIDDLE * 2 * RADIUS * YOUNG)
    # Hertz's line; of a ring that grows wider, its section shrinks by half of its strain.
    width = 2 * load[:2] / (np.pi / 0.75)
    theory = width * (np.log(4 / width) - 1) + (load[:2] / np.pi if not coefficient else 0.0)
    assert theory == pytest.approx(squeeze[:2], rel=0.05)
    ratio = load / (1.25 * squeeze**1.5 + 50 * squeeze**6)
    assert ratio[squeeze > 0.14] == pytest.approx(1.0 if not coefficient else 4 / 3, rel=0.045)
