"""The forces that the certificate computes by NumPy, against the compiled forms and the solver's contact boundary."""

from dataclasses import replace

import numpy as np
import pytest
from dolfinx import fem
from dolfinx import mesh as dmesh
from mpi4py import MPI
from scenes import example1
from spaces import box

from signorini_fx.mechanics.assembly.mesh_entities import action, assemble
from signorini_fx.mechanics.body.discretisation import discretise
from signorini_fx.records import Timings
from signorini_fx.results.certificate.nodal_forces import NodalForces
from signorini_fx.scenes.mesh import load_mesh
from signorini_fx.scenes.reading import parse_scene

LOADS = {
    "body_force": {"x": "x[1]", "y": -3.0},
    "traction": [
        {"boundary": "top", "pressure": "1 + x[0]**2", "x": "x[0]", "factors": [0.5, 1.0]},
        {"boundary": "right", "y": 2.0, "factors": [1.0, -1.0]},
    ],
}
BODIES = {
    "Q1": ({"generator": "block", "parameters": {"nx": 7, "ny": 3, "layout": "unstructured"}}, {}),
    "P1": ({"generator": "wedge", "parameters": {"nx": 4, "ny": 6, "cell": "triangle"}}, {}),
    "Q2": ({"generator": "wedge", "parameters": {"nx": 4, "ny": 6}}, {"degree": 2}),
    "P2": ({"generator": "rectangle", "parameters": {"nx": 5, "ny": 3, "cell": "triangle"}}, {"degree": 2}),
    "curved P2": ({"generator": "punch", "parameters": {"contact_size": 0.1, "order": 2}}, {"degree": 2}),
    "curved Q2": (
        {"generator": "punch", "parameters": {"contact_size": 0.1, "order": 2, "cell": "quadrilateral"}},
        {"degree": 2},
    ),
    "reduced Q1": ({"generator": "wedge", "parameters": {"nx": 4, "ny": 6}}, {"volumetric": "reduced"}),
    "reduced Q2": ({"generator": "wedge", "parameters": {"nx": 4, "ny": 6}}, {"degree": 2, "volumetric": "reduced"}),
}
CONTACT = {"block": "bottom", "wedge": "left", "rectangle": "bottom", "punch": "foot"}


@pytest.mark.one_quick
@pytest.mark.mpi(slow=True)
@pytest.mark.parametrize("hypothesis", ["plane strain", "plane stress"])
@pytest.mark.parametrize("body", BODIES)
def test_against_compiled_forms(body, hypothesis):
    """Internal and external forces, weights and normals: the same to round-off, on any number of ranks."""
    mesh, element = BODIES[body]
    scene = parse_scene(
        {
            "mesh": mesh,
            "element": element,
            "material": {"young": 5000.0, "poisson": 0.4, "hypothesis": hypothesis},
            "contact": {"boundary": CONTACT[mesh["generator"]]},
            **LOADS,
        }
    )
    scene = scene.model_copy(
        update={"body_force": scene.body_force.model_copy(update={"x": lambda x: np.sin(x[0]) + x[1]})}
    )
    tagged = load_mesh(scene, MPI.COMM_WORLD)
    there = discretise(scene.statement, tagged, Timings())
    here = NodalForces(scene.statement, tagged, there.space)
    u = fem.Function(there.space)
    u.interpolate(lambda x: np.stack([np.sin(x[0] * x[1] + x[0]), np.cos(x[1] - 2 * x[0])]))
    u.x.scatter_forward()
    close(here.internal(u), compiled(there, u))
    for step in range(2):
        total = np.zeros(there.fixed.size)
        for case in there.applied:
            for form in case.forms:
                total += case.factors[step] * assemble(form)
        close(here.external(step), total)
    moments = here.moments(scene.contact[0].boundary)
    boundary = there.boundary
    expected = np.zeros_like(moments)
    expected[boundary.nodes] = boundary.weight[:, None] * boundary.normal
    np.testing.assert_allclose(moments, expected, rtol=0, atol=1e-13)


def compiled(discretisation, u):
    """a(u, .) by the compiled forms."""
    index_map = discretisation.space.dofmap.index_map
    nodes = np.arange(index_map.size_local + index_map.num_ghosts, dtype=np.int32)
    return action(discretisation.forms, u, nodes)


def close(ours, theirs):
    """Equal to round-off of the largest entry."""
    largest = MPI.COMM_WORLD.allreduce(np.abs(theirs).max(initial=0.0), MPI.MAX)
    theirs = theirs.reshape(-1, 2)
    np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-12 * largest)


def test_several_materials():
    """Each cell has its own moduli."""
    scene = example1(nx=6, ny=4)
    tagged = load_mesh(scene, MPI.COMM_SELF)
    mesh = tagged.mesh
    cells = np.arange(mesh.topology.index_map(2).size_local, dtype=np.int32)
    upper = (dmesh.compute_midpoints(mesh, 2, cells)[:, 1] > 0.5).astype(np.int32)
    tags = dmesh.meshtags(mesh, 2, cells, upper)
    tagged = replace(tagged, cell_tags=tags, regions={"lower": 0, "upper": 1})
    material = scene.material[0]
    two = (
        material.model_copy(update={"region": "lower"}),
        material.model_copy(update={"region": "upper", "young": 100.0, "poisson": 0.1}),
    )
    scene = scene.model_copy(update={"material": two})
    there = discretise(scene.statement, tagged, Timings())
    u = fem.Function(there.space)
    u.interpolate(lambda x: np.stack([np.sin(x[0] * x[1]), np.cos(x[1] - 2 * x[0])]))
    close(NodalForces(scene.statement, tagged, there.space).internal(u), compiled(there, u))


@pytest.mark.parametrize("degree", [1, 2])
def test_a_warped_side_of_a_cell(degree):
    """A block of one cell, turned by 1.2 from bottom to top: where the plane of its side leaves its middle outside."""
    tagged = box("hexahedra", (1, 1, 1), size=(2.4, 0.8, 1.0))
    x = tagged.mesh.geometry.x
    x -= [1.2, 0.4, 0.0]
    x[:, :2] = [[np.cos(1.2 * z) * a - np.sin(1.2 * z) * b, np.sin(1.2 * z) * a + np.cos(1.2 * z) * b] for a, b, z in x]
    scene = parse_scene(
        {
            "mesh": tagged,
            "element": {"degree": degree},
            "material": {"young": 1.0, "poisson": 0.3},
            "contact": [{"boundary": "front"}, {"boundary": "left"}],
        }
    )
    there = discretise(scene.statement, tagged, Timings())
    here = NodalForces(scene.statement, tagged, there.space)
    for part, effect in enumerate(scene.contact):
        mine = there.boundary.part == part
        moments = here.moments(effect.boundary)[there.boundary.nodes[mine]]
        expected = there.boundary.weight[mine, None] * there.boundary.normal[mine]
        np.testing.assert_allclose(moments, expected, rtol=0, atol=1e-14)
