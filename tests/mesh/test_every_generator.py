"""Every generator, in 2D and in 3D: the same mesh every time, on ranks and in all units; coarser ones."""

import inspect

import numpy as np
import pytest
import test_generators as plane
import test_meshes_in_space as space
from mpi4py import MPI

from signorini_fx.errors import SceneError
from signorini_fx.machine.compat import geometry_cells
from signorini_fx.mechanics.mesh.tagged import coarser_parameters, generate_mesh
from signorini_fx.mechanics.statement.generators import known_generators

SMALL = plane.SMALL | space.SMALL
NO_LENGTHS = {"angle", "grading"}
# Parameters that are no numbers of cells and give a coarser mesh as well.
COARSER = {"bracket": {"contact_size": 1.5, "size": 3.0}}
each = pytest.mark.parametrize("name", SMALL)


def make(name, comm=MPI.COMM_SELF, **changes):
    """The small mesh of a generator."""
    return generate_mesh(name, SMALL[name][0] | changes, comm)


def cells_of_all(tagged):
    """How many there are."""
    return tagged.mesh.topology.index_map(tagged.mesh.topology.dim).size_global


def test_all_are_here():
    """No generator is without these tests."""
    assert sorted(SMALL) == list(known_generators())


@pytest.mark.one_quick
@each
def test_the_same_mesh_every_time(name):
    """Points and cells, bit by bit."""
    first, second = make(name), make(name)
    np.testing.assert_array_equal(first.mesh.geometry.x, second.mesh.geometry.x)
    np.testing.assert_array_equal(geometry_cells(first.mesh), geometry_cells(second.mesh))


@pytest.mark.one_quick
@pytest.mark.parametrize("unit", [1e-9, 1e6])
@each
def test_the_same_mesh_in_all_units(name, unit):
    """A body of nanometres or of kilometres has the same cells."""
    parameters = inspect.signature(known_generators()[name]()).parameters.items()
    values = {key: p.default for key, p in parameters} | SMALL[name][0]
    lengths = {k: unit * value for k, value in values.items() if isinstance(value, float) and k not in NO_LENGTHS}
    first, second = make(name), make(name, **lengths)
    np.testing.assert_array_equal(geometry_cells(first.mesh), geometry_cells(second.mesh))
    size = np.abs(first.mesh.geometry.x).max()
    np.testing.assert_allclose(second.mesh.geometry.x / unit, first.mesh.geometry.x, rtol=0, atol=1e-8 * size)


@pytest.mark.one_quick
@pytest.mark.mpi
@each
def test_on_ranks(name):
    """The cells and facets are the same on any number of ranks, and in 3D the areas."""
    comm = MPI.COMM_WORLD
    order = {"order": 2} if name in space.CURVED else {}
    shared, own = make(name, comm, **order), make(name, **order)
    assert cells_of_all(shared) == cells_of_all(own)
    for boundary in own.boundaries:
        assert comm.allreduce(shared.facets(boundary).size) == own.facets(boundary).size, boundary
        if name in space.SMALL:
            assert space.integral(shared, boundary) == pytest.approx(space.integral(own, boundary), rel=1e-12)
    if name in space.SMALL:
        assert space.integral(shared) == pytest.approx(space.integral(own), rel=1e-12)


@pytest.mark.one_quick
@each
def test_coarser(name):
    """Facets twice as long: about a quarter, or an eighth, of the cells, the same names."""
    parameters = SMALL[name][0] | COARSER.get(name, {})
    coarse = generate_mesh(name, coarser_parameters(name, parameters, 2.0), MPI.COMM_SELF)
    fine = generate_mesh(name, parameters, MPI.COMM_SELF)
    assert set(coarse.boundaries) == set(fine.boundaries)
    low, high = (4, 12) if name in space.SMALL else (2.5, 6)
    assert low < cells_of_all(fine) / cells_of_all(coarse) < high


@each
def test_words_that_are_refused(name):
    """With the path of the parameter, at once."""
    wrong = {"cell": "hexagon", "colour": "red"} | ({"order": 3} if name in plane.CURVED + space.CURVED else {})
    for key, value in wrong.items():
        with pytest.raises(SceneError) as caught:
            make(name, **{key: value})
        assert [problem[0] for problem in caught.value.problems] == [f"mesh.parameters.{key}"]
