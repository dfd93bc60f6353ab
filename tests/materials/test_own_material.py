"""A material from outside the package, demos/extensions/material.py, beside the orthotropic one with its constants."""

import runpy
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI
from scipy.spatial.transform import Rotation
from test_orthotropic import assert_uniform, pressed, uniform
from test_springs import body

from signorini_fx import InstallationError, SceneError, extensions, solve
from signorini_fx.extensions import MATERIALS
from signorini_fx.mechanics.body import discretisation
from signorini_fx.mechanics.materials.orthotropic import OrthotropicElastic
from signorini_fx.mechanics.materials.protocol import Material
from signorini_fx.records import Status

DEMO = Path(__file__).parents[2] / "demos" / "extensions" / "material.py"
COMM = MPI.COMM_WORLD
Fibres = runpy.run_path(str(DEMO))["Fibres"]
MODULI = {"n": 9000.0, "c": 1500.0, "k": 2000.0, "m": 600.0, "p": 900.0}
AXES = {2: {"direction": [1.0, 0.5]}, 3: {"direction": [1.0, 0.5, -0.3], "second": [0.2, 1.0, 0.7]}}


@pytest.fixture(autouse=True)
def _registered(monkeypatch):
    """For one test."""
    monkeypatch.setattr(extensions, "_registered", {MATERIALS: {"fibres": Fibres}})


def hill(n, c, k, m, p):
    """Young's moduli, Poisson's ratios and shear moduli by R. Hill, J. Mech. Phys. Solids 12 (1964) 199-212."""
    along = n - c**2 / k
    across = 4 * m * (k * n - c**2) / (k * n - c**2 + m * n)
    nu, nu_across = c / (2 * k), across / (2 * m) - 1
    return {"young": [along, across, across], "poisson": [nu, nu, nu_across], "shear": [p, p, m]}


def own(dimension, kind=Fibres, **more):
    """The material of the demo."""
    return kind(**MODULI, **AXES[dimension], **more)


def orthotropic(dimension, **more):
    """The same once more."""
    return {"orthotropic": hill(**MODULI) | AXES[dimension], **more}


def test_the_demo_is_short():
    """As the gallery says."""
    assert len(DEMO.read_text(encoding="utf-8").splitlines()) <= 40


@pytest.mark.one_quick
@pytest.mark.mpi
@pytest.mark.parametrize("hypothesis", ["plane strain", "plane stress", "axisymmetric", None], ids=str)
def test_as_the_orthotropic_one(hypothesis):
    """Displacement, recovered stress, energies, and iterations; with heat, and in 3D."""
    tagged = body("tetrahedra" if hypothesis is None else "triangle")
    more = {} if hypothesis is None else {"hypothesis": hypothesis}
    dimension = tagged.dimension
    held = {"displacement": [{"boundary": "left", "x": 0.0}], "temperature": {"change": 3.0}}
    first, second = (
        solve(pressed(tagged, material, **held), COMM)
        for material in (own(dimension, **more, expansion=1e-4), orthotropic(dimension, **more, expansion=1e-4))
    )
    assert first.certificate.holds
    assert first.certificate.moduli <= 1e-12
    assert len(first.history.iterations) == len(second.history.iterations)
    size = np.abs(second.displacement.x.array).max()
    np.testing.assert_allclose(first.displacement.x.array, second.displacement.x.array, atol=1e-9 * size)
    stresses = [solution.stress.recovered.tensor.x.array for solution in (first, second)]
    np.testing.assert_allclose(*stresses, atol=1e-8 * np.abs(stresses[1]).max())
    assert first.certificate.strain_energy == pytest.approx(second.certificate.strain_energy, rel=1e-9)


@pytest.mark.one_quick
@pytest.mark.mpi(slow=True)
@pytest.mark.parametrize("cells", ["quadrilateral", "tetrahedra"])
def test_uniform(cells):
    """A bar under a pressure along it, whose fibres are along or across it."""
    tagged = body(cells)
    dim = tagged.dimension
    constants = hill(**MODULI)
    for axis in (0, 1):
        material = Fibres(
            **MODULI, direction=list(np.eye(dim)[axis]), **({"second": list(np.eye(3)[1 - axis])} if dim == 3 else {})
        )
        material = material.model_copy(update={"hypothesis": "plane stress"}) if dim == 2 else material
        (along, across, _), (nu, _, beside) = constants["young"], constants["poisson"]
        strain = np.diag(
            [1 / along, -nu / along, -nu / along] if axis == 0 else [1 / across, -nu / along, -beside / across]
        )
        solution = solve(uniform(tagged, material, 2 if dim == 3 else 1, "full"), COMM, check=False)
        assert_uniform(solution, -3.0 * strain, np.diag([-3.0, 0.0, 0.0]))


@pytest.mark.parametrize("cells", ["triangle", "tetrahedra"])
def test_guaranteed_bounds(cells):
    """Those of the orthotropic material, above the distance to the solution on a finer mesh."""
    if COMM.size > 1:
        pytest.skip("a guaranteed bound is computed on one rank")
    tagged = body(cells)
    solver = {"error_bound": True, "algorithm": "alm"}
    held = {
        "displacement": [{"boundary": "left", "x": 0.0, **({"y": 0.0} if tagged.dimension == 3 else {})}],
        "traction": {"boundary": "top", "pressure": 4.0},
        "contact": {"boundary": "bottom"},
        "solver": solver,
    }
    first, second = (
        solve(pressed(tagged, material, **held), COMM)
        for material in (own(tagged.dimension), orthotropic(tagged.dimension))
    )
    assert first.error_bound.as_dict()["guaranteed"]
    assert first.error_bound.error == pytest.approx(second.error_bound.error, rel=1e-6)


class WrongTwin(Fibres):
    """A independent check with another shear."""

    def stress_at(self, e):
        return super().stress_at(e) + 1e-3 * self.p * e


class WrongBounds(Fibres):
    """A least modulus that is too large."""

    @property
    def moduli(self):
        return 1.001 * super().moduli[0], super().moduli[1]


class TooSoft(Fibres):
    """A largest one that is too small."""

    @property
    def moduli(self):
        return super().moduli[0], 0.999 * super().moduli[1]


@pytest.mark.mpi
@pytest.mark.parametrize(("kind", "figure"), [(WrongTwin, "equilibrium"), (WrongBounds, "moduli"), (TooSoft, "moduli")])
def test_the_certificate_notices(kind, figure, monkeypatch):
    """Faults of a material by the figures that judge it, if nobody looks before."""
    monkeypatch.setattr(discretisation, "check_materials", lambda _: None)
    scene = pressed(body("triangle"), own(2, kind), displacement={"boundary": "left", "x": 0.0})
    solution = solve(scene, COMM, check=False)
    assert solution.status is Status.NOT_CERTIFIED
    assert getattr(solution.certificate, figure) > 1e-4


def lying(**methods):
    """The material of the demo with other methods."""
    return type("Lying", (Fibres,), {"__module__": __name__, **methods})


def constant(value):
    """A property."""
    return property(lambda _: value)


def halved(self, x):
    """Axes that are half as long."""
    return 0.5 * Fibres.axes(self, x)


def doubled(self, strain):
    """An isotropic stress."""
    return 2 * strain


@pytest.mark.parametrize(
    ("methods", "message"),
    [
        (
            {"moduli": constant((-1.0, 1e5))},
            r"moduli of Lying are -1 and 100000, not bounds of its eigenvalues 1200 to",
        ),
        ({"moduli": constant((np.nan, 1e5))}, "moduli of Lying are nan"),
        ({"moduli": constant((1e-3, np.nan))}, "moduli of Lying are 0.001 and nan"),
        ({"moduli": constant((1e5, 1e-3))}, "moduli of Lying are 100000"),
        ({"moduli": constant((1300.0, 1e5))}, "moduli of Lying are 1300"),
        ({"moduli": constant((1.0, 9000.0))}, "moduli of Lying are 1 and 9000"),
        ({"moduli": constant(1.0)}, "moduli of Lying are no two numbers: TypeError"),
        ({"stress": lambda law, e: law.p * e * np.nan}, "stress of Lying is not finite"),
        ({"stress": lambda law, e: -law.p * e}, "does no work on some strain"),
        ({"stress": lambda law, e: law.p * e * (2 + e[0, 0])}, "no linear function of the strain"),
        ({"stress": lambda law, e: law.p * e + law.m}, "no linear function of the strain"),
        ({"stress": Material.stress}, "Lying does not say its stress"),
        ({"stress_at": Material.stress_at}, "Lying does not say its stress_at"),
        ({"stress_at": lambda law, e: Fibres.stress_at(law, e) + 1e-3 * law.p * e}, "stress_at of Lying is not its"),
        ({"stress_at": lambda law, e: Fibres.stress_at(law, e)[0]}, "stress_at of Lying has the shape"),
        ({"stress_at": lambda law, e: e / law.nothing}, "stress_at of Lying fails: AttributeError"),
        ({"stress_at": lambda law, e: Fibres.stress_at(law, np.add(e, 0, out=e))}, "stress_at of Lying fails: .*only"),
        ({"stress_at": lambda law, e: np.triu(Fibres.stress_at(law, e))}, "stress_at of Lying is not its stress"),
        ({"isotropic": constant(True)}, "Lying is not isotropic, as it says"),
        (
            {"isotropic": True, "stress": doubled, "stress_at": doubled, "moduli": constant((2.0, 2.0))},
            "derive it from LinearElastic",
        ),
        ({"free_strain": constant((1.0, np.inf, 1.0))}, "free_strain of Lying"),
        ({"axes": halved}, "must be unit vectors at right angles"),
        ({"axes": lambda *_: np.eye(3)}, "must have the shape"),
    ],
)
def test_materials_that_are_not_what_they_say(methods, message):
    """Are refused by name before anything is assembled: no proof rests on them."""
    scene = pressed(body("triangle", comm=MPI.COMM_SELF), own(2, lying(**methods)))
    with pytest.raises(SceneError, match=message):
        solve(scene, MPI.COMM_SELF)


def test_no_energy():
    """A stress that follows another strain than that which follows it has none."""
    import ufl

    def skew(law, e):
        return Fibres.stress(law, e) + law.p * e[0, 0] * ufl.as_matrix([[0, 0, 0], [0, 1, 0], [0, 0, 0]])

    scene = pressed(body("triangle", comm=MPI.COMM_SELF), own(2, lying(stress=skew)))
    with pytest.raises(SceneError, match="has no energy: its stiffness is not symmetric"):
        solve(scene, MPI.COMM_SELF)


def test_missed():
    """Moduli beyond the eigenvalues, moduli that bound nothing, and a stress that is not that of an energy."""

    def skew(law, e):
        return Fibres.stress_at(law, e) + law.p * e[..., :1, :1] * np.diag([0.0, 1.0, 0.0])

    assert own(2).missed() <= 1e-12
    least, most = own(2).eigenvalues
    assert own(2, lying(moduli=constant((1.01 * least, 2 * most)))).missed() == pytest.approx(0.01)
    assert own(2, lying(moduli=constant((0.5 * least, most / 1.02)))).missed() == pytest.approx(0.02)
    assert np.isinf(own(2, lying(moduli=constant((-1.0, 2 * most)))).missed())
    skewed = own(2, lying(stress_at=skew, moduli=constant((0.1 * least, 10 * most))))
    assert skewed.missed() == pytest.approx(MODULI["p"] / skewed.eigenvalues[1])


def test_mean_over_all_directions():
    """Lame parameters against the mean of the stress over the rotations of the icosahedron, which is exact for tensors
    of fourth order.
    """
    rotations = Rotation.create_group("I").as_matrix()
    material = own(3)
    for pair in ((0, 0), (0, 1)):
        strain = np.zeros((3, 3))
        strain[pair] = strain[pair[::-1]] = 1.0
        turned = np.einsum("nai,ab,nbj->nij", rotations, strain, rotations)
        mean = np.einsum("nai,nij,nbj->ab", rotations, material.stress_at(turned), rotations) / len(rotations)
        first, second = material.lame
        np.testing.assert_allclose(mean, first * np.trace(strain) * np.eye(3) + 2 * second * strain, atol=1e-9)


def test_by_name():
    """As a scene file has it; wrong names, wrong keys and what is no material are named."""
    table = {"law": "fibres", **MODULI, "direction": [1.0, 0.5]}
    assert pressed(body(), table).material[0] == own(2)
    for wrong, message in (
        ({"law": "fibre"}, r"material.*there is no material 'fibre'.*fibres"),
        ({**table, "n": "many"}, r"material.*n: must be a number"),
        ({**table, "young": 1.0}, r"material.*young: unknown key"),
    ):
        with pytest.raises(SceneError, match=message):
            pressed(body(), wrong)
    extensions.register(MATERIALS, "fibres", dict)
    with pytest.raises(InstallationError, match="is not a Material"):
        pressed(body(), table)


def test_no_plane_of_symmetry():
    """A plane body would not stay plane."""

    class Tilted(Fibres):
        def axes(self, x):
            return np.broadcast_to(np.linalg.qr(np.array([[1.0, 0, 0], [1, 1, 0], [1, 1, 1]]))[0], (x.shape[1], 3, 3))

    with pytest.raises(SceneError, match="plane of symmetry"):
        solve(pressed(body(comm=MPI.COMM_SELF), own(2, Tilted)), MPI.COMM_SELF)


@pytest.mark.parametrize("material", [own(3), OrthotropicElastic(**orthotropic(3))], ids=["own", "orthotropic"])
def test_both_opinions(material):
    """Stress, independent check and bounds of strains at random."""
    chance = np.random.default_rng(1)
    strain = chance.normal(size=(40, 3, 3))
    strain += strain.swapaxes(1, 2)
    components = [strain[:, i, j] * (1 if i == j else 2) for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]
    expected = Material.stiffness.fget(material) @ components
    stress = material.stress_at(strain)
    np.testing.assert_allclose(
        [stress[:, i, j] for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))], expected, rtol=1e-9, atol=1e-6
    )
    ratio = np.sum(stress * strain, axis=(1, 2)) / np.sum(strain**2, axis=(1, 2))
    assert material.moduli[0] <= ratio.min() <= ratio.max() <= material.moduli[1]
    assert material.missed() <= 1e-12
