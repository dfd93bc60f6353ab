"""Checkpoints for other programs: dolfinx and io4dolfinx alone read them, on other numbers of ranks."""

import os

import numpy as np
import pytest
import ufl
from dolfinx import fem
from mpi4py import MPI
from scenes import alone

from signorini_fx import solve
from signorini_fx.errors import InstallationError, OutputError
from signorini_fx.machine import compat
from signorini_fx.results import exported_checkpoint
from signorini_fx.scenes.reading import parse_scene

COMM = MPI.COMM_WORLD
LIBRARY = compat.checkpoint_library()
FIELDS = {"displacement": (2,), "pressure": (), "shear": (2,), "gap": (), "slip": (2,)}


@pytest.fixture
def library(monkeypatch):
    """What another program reads with."""
    monkeypatch.setenv("ADIOS2_ALWAYS_USE_MPI", "1")
    return pytest.importorskip(LIBRARY, reason=f"{LIBRARY} is not installed", exc_type=ImportError)


def scene(degree):
    """Two load steps: more and more of a gap closes, and slips."""
    return parse_scene(
        {
            "mesh": {"generator": "rectangle", "parameters": {"length": 3.0, "height": 1.0, "nx": 12, "ny": 5}},
            "element": {"degree": degree},
            "material": {"young": 5000.0, "poisson": 0.3},
            "displacement": {"boundary": "left", "x": 0.0},
            "traction": {"boundary": "top", "y": "-10.0 - 8.0 * x[0]", "factors": [0.4, 1.0]},
            "contact": {
                "boundary": "bottom",
                "gap": "0.001 * x[0]",
                "friction": {"law": "coulomb", "coefficient": 0.3},
            },
        }
    )


def moments(comm, functions, ds, tag):
    """Integrals over the body and the contact boundary that tell wrong places, components and names apart."""
    domain = functions["displacement"].function_space.mesh
    x, y = ufl.SpatialCoordinate(domain)
    weight = ufl.as_vector((1 + x * y, x - y**2))
    u = functions["displacement"]
    forms = [u[0] * weight[0] * ufl.dx, u[1] * weight[1] * ufl.dx]
    for name in ("pressure", "gap"):
        forms.append(functions[name] * x**2 * ds(tag))
    for name in ("shear", "slip"):
        forms.append(ufl.inner(functions[name], weight) * ds(tag))
    return np.array([comm.allreduce(fem.assemble_scalar(fem.form(form))) for form in forms])


def read(library, file, comm, degree, time):
    """The integrals of what is in a file, by names alone."""
    domain = library.read_mesh(file, comm)
    tags = library.read_meshtags(file, domain, meshtag_name="boundaries")
    tag = int(library.read_attributes(file, comm, "tag_of")["bottom"][0])
    functions = {}
    for name, shape in FIELDS.items():
        functions[name] = fem.Function(fem.functionspace(domain, ("Lagrange", degree, shape)))
        library.read_function(file, functions[name], time=time, name=name)
    return moments(comm, functions, ufl.Measure("ds", domain, subdomain_data=tags), tag)


def expected(solution):
    """The same of each load step, from the solution."""
    tagged, comm = solution.model.tagged, solution.comm
    ds = ufl.Measure("ds", tagged.mesh, subdomain_data=tagged.facet_tags)
    rows = []
    for step in solution.steps:
        fields = exported_checkpoint.ContactFields.on(solution.model.space)
        fields.take(solution.model.space, step.contact)
        functions = {name: getattr(fields, name) for name in FIELDS if name != "displacement"}
        rows.append(moments(comm, functions | {"displacement": step.displacement}, ds, tagged.boundaries["bottom"]))
    return np.array(rows)


@pytest.mark.one_quick
@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.mpi(slow=True)
def test_another_number_of_ranks(degree, library, tmp_path):
    """Written by all ranks, read by one, by all but one, and by all; written by one, read by all."""
    stated = scene(degree)
    everyone, first = COMM.bcast(str(tmp_path / "all.bp")), COMM.bcast(str(tmp_path / "one.bp"))
    solution = solve(stated, COMM)
    assert solution.converged
    solution.write_checkpoint(everyone)
    serial = alone(stated)
    if COMM.rank == 0:
        serial.write_checkpoint(first)
    COMM.barrier()
    known = expected(serial)
    assert np.abs(known).min() > 0
    assert np.abs(known[1] / known[0] - 1).min() > 0.1  # the load steps are not the same
    assert expected(solution) == pytest.approx(known, rel=1e-7)
    some = COMM.Split(min(COMM.rank, 1), COMM.rank)
    readers = [(MPI.COMM_SELF, everyone), (some, everyone), (COMM, everyone), (COMM, first)]
    # adios4dolfinx reads on several ranks by graphs of them, the making of which Open MPI 5.0.7 does not always end.
    for comm, file in readers if LIBRARY == "io4dolfinx" else readers[:1]:
        found = [read(library, file, comm, degree, time) for time in (1.0, 2.0)]
        assert np.array(found) == pytest.approx(known, rel=1e-7)
    some.Free()


def test_what_is_in_the_way(library, tmp_path):
    solution = alone(scene(1))
    (tmp_path / "thesis").mkdir()
    (tmp_path / "thesis/chapter.tex").write_text("years")
    with pytest.raises(OutputError, match="thesis: is a folder of other files, and no checkpoint: choose another name"):
        solution.write_checkpoint(tmp_path / "thesis")
    assert os.listdir(tmp_path / "thesis") == ["chapter.tex"]
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="file: cannot be written: File exists"):
        solution.write_checkpoint(tmp_path / "file")


def test_without_the_library(monkeypatch, tmp_path):
    monkeypatch.setattr(exported_checkpoint, "find_spec", lambda name: None)
    missing = f"need {LIBRARY}, which is not installed: apt install python3-{LIBRARY}"
    with pytest.raises(InstallationError, match=missing):
        alone(scene(1)).write_checkpoint(tmp_path / "solution.bp")
    assert not (tmp_path / "solution.bp").exists()
