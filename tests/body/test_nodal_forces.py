"""The contact boundary that the certificate computes by NumPy, against that of the solver."""

import numpy as np
import pytest
from spaces import box

from signorini_fx.mechanics.assembly.mesh_entities import action
from signorini_fx.mechanics.body.discretisation import discretise
from signorini_fx.records import Timings
from signorini_fx.results.certificate.nodal_forces import NodalForces
from signorini_fx.scenes.reading import parse_scene


def compiled(discretisation, u):
    """a(u, .) by the compiled forms."""
    index_map = discretisation.space.dofmap.index_map
    nodes = np.arange(index_map.size_local + index_map.num_ghosts, dtype=np.int32)
    return action(discretisation.forms, u, nodes)


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
