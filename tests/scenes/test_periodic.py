"""Periodic cells: a constant strain, and Westergaard's wavy surface, on any number of ranks."""

import numpy as np
import pytest
from mpi4py import MPI

from signorini_fx import (
    LinearElastic,
    MeshError,
    PrescribedDisplacement,
    Scene,
    SurfaceTraction,
    UnilateralContact,
    generate_mesh,
    periodic_sides,
    solve,
)

COMM = MPI.COMM_WORLD
YOUNG, POISSON = 1000.0, 0.3
GRADIENT = 1e-3 * np.array([[1.0, 0.5, 0.4], [-0.2, 0.7, 0.3], [0.1, -0.6, -0.4]])
STIFF = 1e5  # what links give way is a share of about 1e-5 of the strain


@pytest.fixture
def folder(tmp_path):
    """One for all ranks."""
    return COMM.bcast(tmp_path)


@pytest.mark.mpi
@pytest.mark.parametrize(
    ("generator", "cell", "degree"),
    [
        ("rectangle", "triangle", 1),
        ("rectangle", "quadrilateral", 2),
        ("box", "hexahedron", 1),
        ("box", "tetrahedron", 2),
    ],
)
def test_a_mean_strain(folder, generator, cell, degree):
    """Between two prescribed sides the differences of the others give a gradient that is the same everywhere."""
    dim = 2 if generator == "rectangle" else 3
    size = np.array([2.0, 1.0] if dim == 2 else [2.0, 1.5, 1.0])
    parameters = {"length": 2.0, "height": 1.0, "nx": 4, "ny": 3, "cell": cell}
    if dim == 3:
        parameters |= {"width": 1.5, "nz": 2}
    mesh = generate_mesh(generator, parameters, COMM)
    across = [("left", "right", 0), ("front", "back", 1)][: dim - 1]
    links, forces = [], []
    for side, opposite, axis in across:
        difference = GRADIENT[:dim, axis] * size[axis]
        file, k = folder / f"{side}.csv", STIFF * YOUNG
        link, force = periodic_sides(mesh, side, opposite, file, stiffness=k, difference=difference, degree=degree)
        links.append(link)
        forces.append(force)
    affine = {"xyz"[i]: " + ".join(f"({GRADIENT[i, j]}) * x[{j}]" for j in range(dim)) for i in range(dim)}
    scene = Scene(
        mesh=mesh,
        element={"degree": degree},
        material=LinearElastic(young=YOUNG, poisson=POISSON),
        displacement=[PrescribedDisplacement(boundary=name, **affine) for name in ("bottom", "top")],
        links=links,
        point_force=forces,
    )
    solution = solve(scene, COMM)
    assert solution.converged
    space = solution.displacement.function_space
    x = space.tabulate_dof_coordinates()[:, :dim]
    u = solution.displacement.x.array.reshape(-1, dim)
    assert np.abs(u - x @ GRADIENT[:dim, :dim].T).max() <= 3 / STIFF * np.abs(GRADIENT).max() * size.max()


@pytest.mark.one_quick
@pytest.mark.mpi
@pytest.mark.parametrize("share", [0.1, 0.25, 0.5, 0.75])
def test_a_wavy_surface(folder, share):
    """Westergaard 1939: mean pressure against contact length and peak; the crest lies beside the side of the cell.

    The length is that of the second moment of the pressures: that of sin(pi x / L) is sin(pi a / L)^2 / 4.
    """
    length, height, crest = 1.0, 1e-4, 0.05
    modulus = YOUNG / (1 - POISSON**2)
    closing = np.pi * modulus * height / length
    mesh = generate_mesh("rectangle", {"length": length, "height": length, "nx": 64, "ny": 64}, COMM)
    links, force = periodic_sides(mesh, "left", "right", folder / "sides.csv", stiffness=STIFF * YOUNG)
    assert force is None
    scene = Scene(
        mesh=mesh,
        material=LinearElastic(young=YOUNG, poisson=POISSON),
        displacement=[PrescribedDisplacement(boundary="top", x=0.0)],
        traction=[SurfaceTraction(boundary="top", y=-share * closing)],
        contact=[UnilateralContact(boundary="bottom", gap=f"{height} * (1 - cos(2 * pi * (x[0] - {crest})))")],
        links=[links],
    )
    solution = solve(scene, COMM)
    assert solution.converged
    table = solution.table.columns
    force = table["weight"] * table["pressure"]
    assert force.sum() / length == pytest.approx(share * closing, rel=1e-6)
    moment = np.sum(force * np.sin(np.pi * (table["x"] - crest) / length) ** 2) / force.sum()
    assert np.arcsin(2 * np.sqrt(moment)) / np.pi == pytest.approx(np.arcsin(np.sqrt(share)) / np.pi, rel=1e-2)
    assert 4 * moment * closing == pytest.approx(share * closing, rel=1e-2)
    assert table["pressure"].max() == pytest.approx(2 * np.sqrt(share) * closing, rel=1e-2)
    # Both sides move alike.
    ends = [table["u_n"][np.argmin(np.abs(table["x"] - at))] for at in (0.0, length)]
    assert ends[0] == pytest.approx(ends[1], abs=height / STIFF)


@pytest.mark.mpi
def test_sides_that_do_not_fit(folder):
    """The same error on all ranks: which nodes, and how far from the next one."""
    mesh = generate_mesh("rectangle", {"nx": 4, "ny": 3}, COMM)
    with pytest.raises(
        MeshError, match="'left' and 'top' have no nodes at the same places: 4 and 5 nodes, that of 'left'"
    ):
        periodic_sides(mesh, "left", "top", folder / "sides.csv", stiffness=1.0)
    with pytest.raises(MeshError, match="no boundary 'east'"):
        periodic_sides(mesh, "left", "east", folder / "sides.csv", stiffness=1.0)
