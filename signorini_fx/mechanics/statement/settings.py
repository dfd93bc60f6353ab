"""How a scene is to be solved: algorithms, their parameters and limits, and the requested
accuracy.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import AfterValidator, BeforeValidator, Field

from signorini_fx.algebra import Settings
from signorini_fx.extensions import LINEAR_SOLVERS, names_of
from signorini_fx.mechanics.statement.base import Table
from signorini_fx.mechanics.statement.values import (
    Accepts,
    Automatic,
    Count,
    GivenValue,
    Positive,
    bounded,
    share,
)


def known_linear_algebra() -> tuple[str, ...]:
    """Return the allowed values of ``solver.linear_algebra``: first the kinds of this package, then
    the names of registered linear solvers.
    """
    kinds = ("auto", "full", "krylov", "condensed")
    return (*kinds, *(name for name in names_of(LINEAR_SOLVERS) if name not in kinds))


# What an accuracy is of.
Target = Literal["energy", "pressure", "force", "zone", "peak"]


class Element(Table):
    """The finite element: Lagrange elements of this degree on the cells of the mesh.

    Attributes:
        degree: polynomial degree of the displacement.
        volumetric: ``full``: all terms are integrated exactly; ``reduced``: the volumetric term
            with fewer points, which does not lock as nu -> 0.5 (it equals the mixed
            displacement-pressure element with the pressure eliminated); ``auto``: reduced where
            some nu is at least 0.45 in plane strain and the element has a reduced form; ``mixed``:
            a pressure of degree 1 is an unknown of its own (Taylor-Hood, with degree 2), which does
            not lock either; nu must be above 0, and may be 0.5.

    Examples:
        >>> result = sfx.solve(scene.model_copy(update={"element": sfx.Element(degree=2)}))
        >>> print(result.displacement.function_space.dofmap.index_map.size_global)
        153
    """

    degree: Annotated[int, Field(ge=1, le=2, strict=True)] = 1
    volumetric: Literal["full", "reduced", "auto", "mixed"] = "full"

    @property
    def pressed(self) -> bool:
        """Whether a pressure is an additional unknown."""
        return self.volumetric == "mixed"


def _linear_algebra(kind: str) -> str:
    names = known_linear_algebra()
    if kind not in names:
        raise ValueError(f"must be one of {', '.join(map(repr, names))}, got {kind!r}")
    return kind


class SolverSettings(Table):
    """The settings of the solver; the defaults work for every scale and unit.

    Attributes:
        algorithm: how the regularisation is treated: ``ssn`` (gamma as given), ``continuation``
            (from a first gamma to the given one), ``path-following`` (the smallest gamma that
            ``regularisation_error`` needs), ``alm`` (augmented Lagrangian, section 5, without
            regularisation in the limit); ``auto`` is ssn.
        coulomb: how the friction bound is coupled to the pressure: ``fp`` (fixed-point iteration of
            Tresca problems, section 6.3; with alm it is (ALM-FP)) or ``newton`` (monolithic, falls
            back to fp); ``auto`` is newton where a coarser mesh gives the start, else fp.
        gamma_n: regularisation of the contact condition, gamma_1 of the paper, stress per length.
            ``auto``: 1e5 times Young's modulus over the size of the body.
        gamma_t: regularisation of the friction condition, gamma_2 of the paper; ``auto`` as above.
        sigma: sigma of Algorithm (SSN), length per stress. ``auto``: infinite, that is, a node
            never jumps from one slip set to the other but passes through stick, which is how sigma
            = 1 acts in the paper's units.
        initial_contact: the nodes of the first contact set. ``all``: the solution of the
            unconstrained dual problem; an expression (true or > 0): a patch that is forced into
            contact. ``auto``: all.
        gamma_first: continuation: the first gamma; ``auto``: 1e-4 of the last.
        gamma_factor: alm without Coulomb friction: factor by which gamma grows from one problem to
            the next.
        inner_iterations: alm without Coulomb friction: linear solves allowed for one problem
            (inexact); ``auto``: until its sets repeat.
        regularisation_error: path-following: the error allowed, relative to the energy norm of the
            solution; ``auto``: the discretisation error.
        linear_algebra: ``full`` (all unknowns, sparse factorisation), ``krylov`` (all unknowns, CG
            or FGMRES with algebraic multigrid), ``condensed`` (the contact nodes only, dense; on
            several ranks in 2D), ``auto`` (krylov for large bodies in 3D, condensed where it is
            cheaper than full), or the name of a linear solver of another package, see
            ``linalg.krylov``.
        levels: meshes of a nested iteration, each with elements half as large as the previous one;
            the last is the mesh of the scene, which must come from a generator.
        max_iterations: linear solves allowed for one regularised problem.
        max_outer_iterations: outer iterations allowed.
        tolerance: an outer iteration stops when what it updates (fp: the friction bound; alm:
            lambda and mu) changes relatively by no more than this.
        largest_deformation: the largest deformation that is accepted: mean size of the displacement
            gradient (strain and rotation), and largest displacement relative to the size of the
            body; beyond it linear elasticity has no meaning, and the outcome says so.
        fallbacks: whether other methods are tried where this one cycles or does not converge; the
            history lists them. A limit on iterations that is lower than its default ends the solve
            without them.
        error_bound: whether the summary has a guaranteed bound of the error in the energy norm.

    Examples:
        >>> exact = scene.model_copy(update={"solver": sfx.SolverSettings(algorithm="alm")})
        >>> result = sfx.solve(exact)
        >>> print(result.certificate.penetration < 1e-9, np.round(result.contact.forces[0], 6))
        True [0. 4.]
    """

    algorithm: Literal["auto", "ssn", "continuation", "path-following", "alm"] = "auto"
    coulomb: Literal["auto", "fp", "newton"] = "auto"
    gamma_n: Automatic = "auto"
    gamma_t: Automatic = "auto"
    sigma: Automatic = "auto"
    initial_contact: Literal["auto", "all"] | GivenValue = "auto"
    gamma_first: Automatic = "auto"
    gamma_factor: Annotated[
        float, Field(ge=1, allow_inf_nan=False, strict=True), AfterValidator(bounded)
    ] = 1.0
    inner_iterations: Count | Literal["auto"] = "auto"
    regularisation_error: Automatic = "auto"
    linear_algebra: Annotated[str, AfterValidator(_linear_algebra)] = "auto"
    levels: Annotated[int, Field(ge=1, le=12, strict=True)] = 1
    max_iterations: Count = Settings.max_iterations
    max_outer_iterations: Count = Settings.max_outer_iterations
    tolerance: Positive = Settings.tolerance
    largest_deformation: Positive = 0.5
    fallbacks: bool = True
    error_bound: bool = False


class Units(Table):
    """Names of the units that the numbers of a scene are in: for labels only, nothing is converted.

    Attributes:
        length: such as ``mm``; empty: not named.
        stress: such as ``MPa``.
        force: such as ``N``; empty: that which belongs to the other two, if it has a name.

    Examples:
        >>> named = scene.model_copy(update={"units": sfx.Units(length="mm", stress="MPa")})
        >>> print(named.units.length, np.round(sfx.solve(named).contact.forces[0], 6))
        mm [0. 4.]
    """

    length: str = ""
    stress: str = ""
    force: str = ""


class Accuracy(Table):
    """A requested accuracy: meshes are refined, and gamma is increased, until the estimated error
    meets it.

    Attributes:
        target: relative error allowed; a text such as ``"5%"`` is a share, too.
        of: what the error is of: the displacement in the energy norm, the contact pressure in L2,
            contact and friction force, the ends of the contact zones, or the largest pressure.
        refinement: ``uniform``: the mesh is made finer everywhere; ``adaptive``: triangles are
            divided where the estimated error is large; ``auto``: plane bodies with straight sides
            get adaptively refined triangles of degree 2, in contact with each other for the
            displacement alone, and those with arcs from a generator such cells made anew; drawings
            (.geo) and mesh files with curved cells get elements of degree 2, refined uniformly;
            otherwise uniform.
        seconds: wall time allowed; None: no limit.
        memory: peak memory of all ranks allowed, GB; None: 80 % of what the machine has.

    Examples:
        >>> print(sfx.Accuracy(target="5%", of="pressure").target)
        0.05
    """

    target: Accepts[
        float | str, Annotated[float, Field(gt=0, lt=1, strict=True), BeforeValidator(share)]
    ]
    of: Target = "energy"
    refinement: Literal["auto", "uniform", "adaptive"] = "auto"
    seconds: Positive | None = None
    memory: Positive | None = None
