"""Every demo runs as it is, on a coarse mesh, on any number of ranks, and finds what it says."""

import runpy
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI
from numpy.testing import assert_allclose

from signorini_fx.results import files

DEMOS = Path(__file__).parents[2] / "demos"
COMM = MPI.COMM_WORLD
pytestmark = pytest.mark.mpi


@pytest.fixture
def run(tmp_path, monkeypatch):
    """Run a demo in a folder that the ranks share; what its variables are in the end."""
    if COMM.size > 2:
        pytest.skip("one and two ranks are enough")
    folder = COMM.bcast(tmp_path)
    monkeypatch.chdir(folder)

    whole = files.write_results

    def tables(solution, to, **_):
        return whole(solution, to, fields=False, pictures=False)

    def demo(name, cells, *, drawn=True):
        """Of many load steps, and in 3D, only the figure of the demo itself is drawn: the files
        have their tests.
        """
        monkeypatch.setenv("CELLS", str(cells))
        if not drawn:
            monkeypatch.setattr(files, "write_results", tables)
        found = runpy.run_path(str(DEMOS / f"{name}.py"), run_name="__main__")
        COMM.barrier()
        return found

    return demo


def pictures(*names):
    """They are there, below the results of the demos."""
    for name in names:
        assert (Path("results/demos") / f"{name}.png").stat().st_size > 10_000, name


def test_all_are_here():
    """No demo is without its test, and each explains itself before it computes."""
    tested = {name.removeprefix("test_") for name in globals() if name.startswith("test_")}
    scripts = {file.stem for file in DEMOS.glob("*.py")} - {
        "paper",
        "tutorial",
    }  # the tables and the notebook have tests of their own
    assert scripts <= tested
    assert len(scripts) >= 5
    for name in scripts:
        text = (DEMOS / f"{name}.py").read_text(encoding="utf-8")
        assert text.startswith("# %% [markdown]\n# # ")
        assert (
            "$$" in text.partition("\n# %%\n")[0]
            or name == "own_effect"
            or name == "friction_sweep"
        )


@pytest.mark.slow
def test_examples_of_the_paper(run):
    """Energies and peaks of the 120 x 40 mesh, as far as half as many cells go."""
    found = run("examples_of_the_paper", 60)
    assert found["energy"]["example1_tresca"] == pytest.approx(0.0231870, rel=3e-3)
    assert found["energy"]["example1_coulomb"] == pytest.approx(0.0234108, rel=3e-3)
    assert found["peak"]["example1_tresca"] == pytest.approx(20.112, rel=5e-3)
    assert found["peak"]["example1_coulomb"] == pytest.approx(20.181, rel=5e-3)
    assert len(found["sliding"]["example1_coulomb"]) == 2
    pictures("example1_tresca/deformed", "example2_tresca/profiles")


@pytest.mark.slow
@pytest.mark.mpi(slow=True)
def test_hertz(run):
    """Half-width and peak of the formula without friction; friction narrows the contact and raises
    its peak.
    """
    found = run("hertz", 20)
    assert found["widths"][0.0] == pytest.approx(1.0, abs=3e-3)
    assert found["peaks"][0.0] == pytest.approx(1.0, abs=3e-3)
    assert found["widths"][0.1] == pytest.approx(0.983, abs=3e-3)
    assert found["widths"][0.3] == pytest.approx(0.953, abs=3e-3)
    assert found["peaks"][0.3] == pytest.approx(1.075, abs=5e-3)
    pictures("hertz/pressure")


@pytest.mark.slow
def test_press_and_slide(run):
    """The loop closes, and its area is the work of friction."""
    found = run("press_and_slide", 24, drawn=False)
    assert found["closing"] < 1e-6
    assert found["area"] == pytest.approx(found["lost"], rel=0.02)
    assert found["force"].max() == pytest.approx(16.3, rel=0.02)
    pictures("press_and_slide/loop")


@pytest.mark.slow
def test_dovetail(run):
    """Equilibrium in every step; friction holds on the way up, and turns round on the way down."""
    found = run("dovetail", 24, drawn=False)
    assert_allclose(found["balance"], found["load"], rtol=1e-6)
    normal, low, high = found["normal"], found["low"], found["high"]
    assert_allclose(normal[:5], low[:5], rtol=1e-5)
    assert normal[5] > 1.08 * low[5]
    assert_allclose(normal[-2:], high[-2:], rtol=1e-5)
    assert found["mean"] == pytest.approx(106, rel=0.01)
    assert found["largest"] == pytest.approx(443, rel=0.05)
    pictures("dovetail/hysteresis")


@pytest.mark.slow
def test_accuracy_and_time(run):
    """The estimate is right within a factor of two, and what was asked for is met."""
    found = run("accuracy_and_time", 96)
    ratios = np.array(found["estimated"]) / found["true"]
    assert ((ratios > 0.5) & (ratios < 2)).all()
    assert found["reached"] < found["TARGET"]
    assert found["true"][-1] < 0.3 * found["true"][0]
    pictures("accuracy_and_time/error_against_time")


@pytest.mark.slow
@pytest.mark.mpi(slow=True)
def test_own_effect(run):
    """The heated block has the pressure of the formula."""
    found = run("own_effect", 24)
    assert found["deviation"] < 1e-9
    (left, _), (right, _) = found["touching"]
    assert 0.5 < left < 1.5 < right < 2.5


@pytest.mark.mpi(slow=True)
def test_own_friction(run):
    """The shear of the law is below its limit, and more friction holds more."""
    found = run("own_friction", 24, drawn=False)
    columns = found["solution"].table.columns
    shear, pressure = np.abs(columns["shear"]), columns["pressure"]
    limit = 3.0 - 3.0 / np.exp(0.1 * pressure)
    assert (shear <= limit * (1 + 1e-6)).all()
    assert (shear >= limit * (1 - 1e-6)).any()


@pytest.mark.mpi(slow=True)
def test_friction_sweep(run):
    """More friction, more stick, more force, and a lower peak, close to those of the 120 x 40
    mesh.
    """
    found = run("friction_sweep", 48)
    assert (np.diff(found["stick"]) >= 0).all()
    assert (np.diff(found["drag"]) > 0).all()
    assert (np.diff(found["peak"]) < 0).all()
    assert found["drag"][-1] == pytest.approx(1.14, rel=0.03)
    assert np.mean(found["solves"]) < 5
    pictures("friction_sweep/sweep")


@pytest.mark.slow
def test_sphere_under_tangential_load(run):
    """Hertz's radius and peak for the force; Cattaneo's stick radius and Mindlin's displacement,
    where nu = 0.49.
    """
    found = run("sphere_under_tangential_load", 3, drawn=False)
    columns = found["table"][0.49]
    assert_allclose(columns["a computed"], columns["a"], rtol=5e-3)
    assert_allclose(columns["p0 computed"], columns["p0"], rtol=0.04)
    assert columns["Q/FP"][-1] == pytest.approx(0.895, abs=5e-3)
    assert_allclose(columns["c/a computed"], columns["c/a"], rtol=0.06)
    assert_allclose(columns["c/a by area"], columns["c/a"], rtol=0.07)
    assert_allclose(found["predicted"][1:], found["moved"][1:], rtol=0.02)
    # Where the press makes a shear of its own the formula must not hold.
    columns = found["table"][0.3]
    assert (columns["c/a by area"] < columns["c/a"] - 0.06).all()
    pictures("sphere_under_tangential_load/push")


@pytest.mark.slow
def test_torsion_of_a_pressed_cylinder(run):
    """The torque of the scalar problem, the stick radius to half a cell, the limit."""
    found = run("torsion_of_a_pressed_cylinder", 5, drawn=False)
    assert found["off"].max() < 2e-3
    sticking = [step.stick for step in found["expected"]]
    assert_allclose(found["stick"], sticking, rtol=0, atol=0.5 / 5)
    assert (np.diff(found["stick"][2:5]) < -0.2).all()
    assert found["torque"][-1] == pytest.approx(2 / 3 * 0.3 * 10.0 * np.pi, rel=2e-3)
    pictures("torsion_of_a_pressed_cylinder/torque")


@pytest.mark.slow
def test_bracket(run):
    """The pressure acts where statics says; the foot is held up to the limit of a rigid foot, and
    no further.
    """
    found = run("bracket", 6, drawn=False)
    assert_allclose(found["through"], found["statics"], rtol=0, atol=1e-8)
    assert_allclose(found["pull"], np.outer((0.0, 0.5, 1.0), (320.0, 160.0)), rtol=0, atol=1e-6)
    assert found["simple"] == pytest.approx(1 / 6.70, rel=0.01)
    assert found["used"] == pytest.approx(1 / 3.206, rel=0.02)
    assert 0.97 < found["at_limit"] * found["used"] < 1.03
    assert found["below"].status.value == "converged"
    assert found["above"].status.value == "slides at the contact pressures found"
    assert any(event.startswith("slides") for event in found["above"].history.events)
    pictures("bracket/foot")


@pytest.mark.slow
@pytest.mark.mpi(slow=True)
def test_friction_from_slip(run):
    """The coefficient is found where there is no noise, and else within its interval of
    confidence.
    """
    found = run("friction_from_slip", 18)
    assert found["without_noise"] == pytest.approx(0.3, abs=1e-6)
    assert found["solves"] <= 10
    assert abs(found["coefficient"] - 0.3) <= 2 * found["deviation"]
    assert found["deviation"] < 0.01


@pytest.mark.slow
def test_crowned_profile(run):
    """The largest pressure comes down to the mean one; the nodes at the edges of the punch have
    half a cell more.
    """
    found = run("crowned_profile", 48)
    least = 1.5 / (1.5 + 3.0 / 48)
    assert found["before"] > 2.5
    assert least - 1e-6 <= found["after"] < 1.02 * least
    pictures("crowned_profile")


@pytest.mark.slow
@pytest.mark.mpi(slow=True)
def test_joint_diagram(run):
    """The share of the bolt is that of springs while the joint is closed; once it is open, the bolt
    takes all.
    """
    found = run("joint_diagram", 1, drawn=False)
    bolt, clamp, loads = found["bolt"], found["clamp"], found["LOADS"]
    assert bolt - clamp == pytest.approx(loads, rel=1e-9, abs=1e-6)
    assert bolt[0] == pytest.approx(found["PRELOAD"], rel=1e-9)
    assert bolt[1] - bolt[0] == pytest.approx(found["share"] * loads[1], rel=0.02)
    assert bolt[-1] == pytest.approx(loads[-1], rel=1e-9)
    pictures("joint_diagram/joint_diagram")


@pytest.mark.slow
def test_dent(run):
    """The force grows less and less, is gone before the circle is back, and leaves a dent; as on
    any ranks.
    """
    found = run("dent", 6)
    depth, force = found["path"].T
    assert found["problem"].certificate.holds
    assert (np.diff(force[:9]) > 0).all()
    assert force[8] < 0.6 * 8 * force[1]
    assert force[-1] == 0
    assert depth[-1] < found["dent"] < depth.max()
    if COMM.size == 1:
        pictures("dent")
