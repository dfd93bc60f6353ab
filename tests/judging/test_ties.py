"""Ties and equations of an input file, beside contact: results of CalculiX, ours, and ones that do not keep to them."""

from pathlib import Path

import numpy as np
import pytest
from foreign_spoils import displacements
from scipy.linalg import null_space
from scipy.sparse import csr_array

from signorini_fx.addons.judging.judge import judge
from signorini_fx.addons.judging.linked_nodes import free_directions
from signorini_fx.addons.judging.own_solution import at_nodes_of, solved
from signorini_fx.addons.judging.problems import judged_problem

DATA = Path(__file__).parent / "data"
CAPPED = {"shelf_capped": "agrees", "press_capped": "agrees with another penalty"}


def result_of(name):
    """Problem, and the displacement of CalculiX at its nodes."""
    problem, reasons = judged_problem(DATA / f"{name}.inp")
    assert reasons == []
    numbers, values = displacements(DATA / f"{name}.dat")
    rows = dict(zip(numbers, values, strict=True))
    return problem, np.array([rows[number] for number in problem.mesh.names.tolist()])


def nodes_on(problem, region, height):
    """Nodes of a body at a height."""
    nodes = np.unique(problem.mesh.cells[problem.mesh.regions[region]])
    return nodes[np.abs(problem.mesh.points[nodes, 2] - height) < 1e-9]


@pytest.mark.parametrize("name", CAPPED)
def test_a_tie_beside_contact(name):
    """Tied nodes are where CalculiX ties them, up to print, and what ties exert is in balance."""
    judgement = judge(DATA / f"{name}.inp", DATA / f"{name}.dat", compare=False)
    assert judgement.word == CAPPED[name], str(judgement)
    assert judgement.figures["supports"]["value"] < 1e-6
    assert judgement.figures["equilibrium"]["value"] < 2e-5


def test_a_bond_is_no_contact_beside_ours():
    """The force beside ours is that of the contact, not that of the tie, too."""
    problem, _ = result_of("press_capped")
    ours = at_nodes_of(solved(problem.solve), problem)
    judgement = judge(DATA / "press_capped.inp", ours)
    assert judgement.word == "agrees with another element", str(judgement)  # ours has no incompatible modes
    assert judgement.beside["force"] < 1e-3


@pytest.mark.parametrize("name", CAPPED)
def test_a_tie_that_does_not_hold(name):
    """All nodes of a side, of which one is held by links and the other one by a bond."""
    problem, v = result_of(name)
    tied = nodes_on(problem, "CAP", 0.5)
    v[tied, 1] += 0.1 * np.abs(v).max()
    judgement = judge(DATA / f"{name}.inp", v, compare=False)
    assert judgement.word == "violates supports", str(judgement)
    assert any("tie" in finding.text or "bond" in finding.text for finding in judgement.findings)


@pytest.mark.parametrize("seed", range(5))
def test_directions_that_links_leave(seed):
    """They are as many as the null space has, keep to all links, and are one where they begin; a link may say the same
    as others, and some components are held.
    """
    draw = np.random.default_rng(seed)
    size = 40
    free = np.sort(draw.permutation(size)[:30])
    rows = np.zeros((9, size))
    for row in rows[:7]:
        row[draw.permutation(size)[:4]] = draw.uniform(-1, 1, 4)
    rows[7], rows[8] = rows[0] - 2 * rows[1], rows[3]
    basis, components = free_directions(csr_array(rows), free, size)
    dense = basis.toarray()
    assert dense.shape[1] == len(components) == null_space(rows[:, free]).shape[1]
    np.testing.assert_allclose(rows @ dense, 0.0, atol=1e-9)
    np.testing.assert_allclose(dense[components], np.eye(len(components)), atol=1e-12)
    assert not dense[np.setdiff1d(np.arange(size), free)].any()


def test_directions_of_a_long_tie():
    """Each node of a fine side is between two of a coarse one, so that all links have nodes in common; as dense blocks
    of all of them this took minutes.
    """
    fine, coarse = 6000, 2001
    place = np.linspace(0, (coarse - 1) * (1 - 1e-9), fine)
    after = place - np.floor(place)
    start, rows = np.floor(place).astype(int) + fine, np.arange(fine)
    entries = np.concatenate((np.ones(fine), after - 1.0, -after)), (np.tile(rows, 3), np.r_[rows, start, start + 1])
    links = csr_array(entries, shape=(fine, fine + coarse))
    basis, components = free_directions(links, np.arange(fine + coarse), fine + coarse)
    assert sorted(components) == list(range(fine, fine + coarse))
    hats = np.maximum(1.0 - np.abs(place - np.arange(10)[:, None]), 0.0)
    np.testing.assert_allclose(
        basis[:, np.searchsorted(components, fine + np.arange(10))][rows].T.toarray(), hats, atol=1e-9
    )


def test_equal_forces_at_nodes_stay_there(tmp_path):
    """A scene takes them as an even traction, which is another problem near the side."""
    text = (DATA / "shelf_CPE4.inp").read_text()
    at = text.index("*DSLOAD")
    (tmp_path / "pushed.inp").write_text(
        text[:at] + "*CLOAD\nBODY_TOP_N, 2, -0.2\n" + text[text.index("*NODE PRINT", at) :]
    )
    problem, reasons = judged_problem(tmp_path / "pushed.inp")
    assert reasons == []
    top = problem.mesh.points[:, 1] == 0.5
    forces = sum(problem.loads.values())
    np.testing.assert_allclose(forces[top], [[0.0, -0.2]] * np.count_nonzero(top), atol=1e-12)
    assert not forces[~top].any()
