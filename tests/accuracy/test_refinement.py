"""Refinement of triangles: names are kept, and what cannot be bisected is refused."""

import numpy as np
import pytest
from mpi4py import MPI

from signorini_fx.errors import MeshError
from signorini_fx.machine import parallel
from signorini_fx.mechanics.assembly.mesh_entities import facet_vertices
from signorini_fx.mechanics.mesh.refinement import refine
from signorini_fx.mechanics.mesh.tagged import generate_mesh

SIDES = {"bottom": 3.0, "right": 1.0, "top": 3.0, "left": 1.0}


def lengths(tagged):
    """Length of every named boundary."""
    mesh = tagged.mesh
    result = {}
    for name in SIDES:
        x = facet_vertices(mesh, tagged.facets(name))
        result[name] = float(
            parallel.global_sum(mesh.comm, np.linalg.norm(x[:, 0] - x[:, 1], axis=1).sum())
        )
    return result


@pytest.mark.mpi
@pytest.mark.parametrize("everything", [True, False], ids=["all", "marked"])
def test_names_are_kept(everything):
    """Boundaries of a refined mesh are those of the mesh, whole and nothing else, and so is the
    region.
    """
    tagged = generate_mesh("block", {"nx": 6, "ny": 3, "cell": "triangle"}, MPI.COMM_WORLD)
    fine = refine(
        tagged, None if everything else np.arange(min(2, len(tagged.cells("body"))), dtype=np.int32)
    )
    assert lengths(fine) == pytest.approx(SIDES)
    index_map = fine.mesh.topology.index_map(2)
    assert len(fine.cells("body")) == index_map.size_local + index_map.num_ghosts
    assert index_map.size_global > tagged.mesh.topology.index_map(2).size_global


def test_quadrilaterals_are_refused():
    """Only triangles can be bisected, and that is said."""
    with pytest.raises(MeshError, match="only triangles"):
        refine(generate_mesh("rectangle", {"nx": 2, "ny": 2}, MPI.COMM_SELF))
