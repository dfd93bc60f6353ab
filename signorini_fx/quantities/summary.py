"""summary.json as pydantic models, from which its schema, its table in the documentation and its
reader are made, and the quantities that other packages add to it; without FEniCSx.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError
from typing_extensions import TypeAliasType

from signorini_fx.errors import InstallationError, ResultError
from signorini_fx.extensions import QUANTITIES, load, names_of
from signorini_fx.machine.display import dataframe, with_error
from signorini_fx.machine.result_files import folder_path, read_csv, read_summary

SCHEMA_VERSION = 1
# The beginning of the reason why a number has no finite value.
NO_FINITE_VALUE = "has no finite value: "


def _closed(schema: dict[str, Any]) -> None:
    """Forbid further keys in a JSON schema, and remove titles and the defaults of absent keys."""
    schema["additionalProperties"] = False
    for entry in (schema, *schema["properties"].values()):
        entry.pop("title", None)
        entry.pop("default", None)


class Row(BaseModel):
    """A table of a summary, such as a row of a list; keys that a later version adds are kept on
    reading.
    """

    model_config = ConfigDict(
        extra="allow", frozen=True, defer_build=True, json_schema_extra=_closed
    )


def described(text: str, **limits: Any) -> Any:
    """Return the field of a key that is always present, with its description."""
    return Field(description=text, **limits)


def perhaps(text: str = "", unit: str = "") -> Any:
    """Return the field of a key that may be absent.

    Args:
        text: its description.
        unit: what its value is measured in, a key of ``units.names_of``.
    """
    return Field(
        default=None, description=text or None, json_schema_extra={"unit": unit} if unit else None
    )


if TYPE_CHECKING:
    from pandas import DataFrame

    Number = float | None
    Vector = list[float | None]
else:
    _UNKNOWN = Field(description="Null where a solve that failed could not compute it.")
    Number = TypeAliasType("number", Annotated[float | None, _UNKNOWN])
    Vector = TypeAliasType("vector", Annotated[list[Number], Field(min_length=2, max_length=3)])
Count = Annotated[int, Field(ge=0)]
Setting = Number | Literal["infinite"]
Runs = list[Annotated[list[Vector], Field(min_length=2, max_length=2)]]
_RUNS = "Runs of neighbouring nodes, each from its first to its last point."


class UsedParameters(Row):
    """Parameters of the algorithms as they were used; `infinite` for those without limit."""

    gamma_n: Setting = None
    gamma_t: Setting = None
    sigma: Setting = None
    regularisation_error: Setting = None


class PieceOfBody(Row):
    """A connected piece of the body."""

    piece: Count
    body: str | None = described("The body of a scene with several that it is of.")
    cells: Count
    bounds: Annotated[list[Vector], Field(min_length=2, max_length=2)]


class FindingRow(Row):
    """A warning or a note about the scene or the result."""

    level: Literal["warning", "note"]
    path: str = described("Key of the scene that it concerns.")
    message: str


class Price(Row):
    """The errors and the cost of one mesh.

    Each error is relative, and null where it cannot be estimated yet.
    """

    level: Count = described("Its number, the coarsest is 0.")
    h: float = described(
        "Mean spacing of the contact nodes; in 3D root of the mean area that they stand for."
    )
    dofs: Count = described("Unknowns.")
    linear_solves: Count = described("Linear solves on this mesh.")
    factorisations: Count = described("Of them with a new factorisation.")
    seconds: float = described("Wall time of everything on this mesh, largest over the ranks.")
    memory: float = described("Peak memory so far of all ranks together, MB.")
    energy: Number = described("Error of the displacement, energy norm.")
    pressure: Number = described("Error of the contact pressure, L2(Gamma_c).")
    force: Number = described("Error of contact and friction force.")
    zone: Number = described(
        "Of the ends of the contact zones, relative to their length; in 3D of the contact area."
    )
    peak: Number = described("Error of the largest pressure.")
    regularisation: float = described("The part of `energy` due to gamma.")
    iteration: float = described("The part due to the iteration.")
    predicted: bool = described("Whether this is a prediction for the next mesh.")


class StepOfResults(Row):
    """The load step that the results belong to."""

    step: int = Field(ge=1)
    name: str
    time: float
    status: str


class CornerFigures(Row):
    """A corner of a foundation that presses between nodes: its force has no area."""

    boundary: str = described("Name of the contact boundary.")
    place: Vector = described("Position of the corner.")
    contact_force: Vector = described("Contact force, normal to the facet under it.")
    friction_force: Vector = described("Friction force, along that facet.")
    state: Literal["stick", "slip"] = described("State of the body there.")
    slip: Number = described("Slip along that facet in the load step.")
    facet: Number = described("Length of the facet under it.")
    contact_width: Number = described(
        "About the width of the contact around it; facets that are longer do not resolve it, and "
        "the force falls as they are refined."
    )


class ContactFigures(Row):
    """A contact boundary, in 2D per unit thickness, with lengths for areas."""

    boundary: str = described("Name of the contact boundary.")
    area: Number = described("Area of the whole boundary.")
    contact_area: Number = described("Area of the nodes in contact.")
    touching_nodes: Count = described("Number of nodes in contact.")
    pressure_integral: Number = described("Integral of the pressure, the normal force N.")
    mean_pressure: Number = described(
        "N over the area in contact; null where nothing is in contact."
    )
    max_pressure: Number = described("Largest nodal pressure.")
    contact_force: Vector = described("Resultant of the pressure on the body of this boundary.")
    friction_force: Vector = described("Resultant of the shear on the body of this boundary.")
    tangential_force: Number = described("Magnitude of the resultant T of the shear.")
    slip_speed: Number | Vector = perhaps(
        "Smallest and largest speed of the nodes that slip, where friction follows it; null where "
        "none does."
    )
    friction_limit: Number = described(
        "Integral of the friction bound, F N for Coulomb friction, for Tresca friction with open "
        "nodes; infinite "
        "for a bond. Of friction with a direction the sum of the largest shears in the direction "
        "of this one."
    )
    friction_moment: Number | Vector = described(
        "Of a boundary that closes around a body: moment of friction about its middle, in 2D "
        "counterclockwise; null of "
        "others."
    )
    moment_limit: Number = described(
        "The largest moment that the friction bounds allow in that direction."
    )


class ZoneRuns(Row):
    """Zones on the contact boundary of a body in 2D."""

    contact: Runs = described(_RUNS)
    stick: Runs = described(_RUNS)
    slip: Runs = described(_RUNS)


class ZoneAreas(Row):
    """Areas on the contact boundary of a body in 3D."""

    contact: Number
    stick: Number
    slip: Number


class RigidBody(Row):
    """A rigid body that forces move."""

    boundary: str = described("The boundary that it may touch.")
    reference: Vector = described("The point that it turns about, before it moves.")
    displacement: Vector = described("Displacement of that point.")
    rotation: Number | Vector = described("Radians; in 3D a vector.")
    force: Vector = described("Of the body on the rigid body.")
    moment: Number | Vector = described("About that point; in 3D a vector.")
    gap_error: Number = described(
        "By how much the gap where the rigid body ends up differs at most from the linearised one, "
        "where it presses, length; "
        "null for bonded boundaries, and for nonlinear bodies, whose gap is that of the place "
        "where the rigid body is."
    )


class SectionForce(Row):
    """The force and the shortening of a tightened section."""

    name: str = described("Name of the preload.")
    force: Number = described("The tension through it.")
    shortening: Number = described("By how much its sides have moved towards each other.")


class BoundaryResultant(Row):
    """The resultant of the forces on one part of the boundary."""

    boundary: str | None = described("Name of the boundary; null: the body force.")
    acts: list[str] = described(
        "Effects there: support, contact, and kinds of loads and resistances."
    )
    force: Vector
    moment: Number | Vector = described("Moment about `about`; in 2D a number, counterclockwise.")
    about: Vector
    acts_at: Vector | None = described(
        "A point of the line of action; null where the forces have no resultant."
    )


class ExtremeOfValue(Row):
    """An extreme value and its place."""

    value: Number
    place: Annotated[list[Number], Field(max_length=3)]
    error: Number = perhaps("As that of `numbers`, of the larger one of raw and recovered stress.")
    region: str | None = perhaps(
        "Name of its body or of the region of its material, if there are several; null: that "
        "without a region."
    )
    no_limit: str | None = perhaps(
        "Why it has no limit as the mesh is refined; null: it has one, or nothing is proved."
    )


class RecoveredExtremes(Row):
    """Extremes of the recovered stress."""

    von_mises: ExtremeOfValue
    largest_principal: ExtremeOfValue
    smallest_principal: ExtremeOfValue
    largest_zz: ExtremeOfValue = perhaps()
    smallest_zz: ExtremeOfValue = perhaps()


class StressExtremes(RecoveredExtremes):
    """Extremes of the raw stress, and of the recovered one."""

    recovered: RecoveredExtremes | None = described(
        "Those of the recovered stress; null of nonlinear materials, and if the displacement is "
        "not a number."
    )
    error: Number = described(
        "Estimated error of the raw stress in the energy norm, relative; null of nonlinear "
        "materials, and without "
        "stress."
    )


class LargestDeformation(Row):
    """The deformation of the load step that deforms most."""

    gradient: Number = described("Mean strain and rotation.")
    displacement: Number = described("Largest displacement, relative to the size of the body.")


class LimitOfRamp(Row):
    """The loads at which a ramp has ended."""

    time: float = described("Time of the last load step with a solution.")
    force: Number = perhaps("Resultant of the forces that grow, at that time.", "force")
    full_force: Number = perhaps("The same where their factor is the next one.", "force")
    loads: str = described("Factors of the loads that grow, at that time.")
    reason: str = described("Why the ramp has ended.")


class CertificateFigures(Row):
    """The figures of the certificate, each relative."""

    equilibrium: Number = described("Forces out of balance, contact tractions included.")
    supports: Number = described("Largest difference from a prescribed displacement.")
    negative_pressure: Number = described("Largest tension that the contact transmits.")
    friction_cone: Number = described("Largest shear beyond the friction bound.")
    wrong_way_slip: Number = described("Slip in the direction of the friction force.")
    entered: Number = described("Deepest penetration beyond that allowed by the law.")
    pressure_at_distance: Number = described("Largest pressure where there is a distance.")
    slip_below_bound: Number = described("Largest slip where the shear is below its bound.")
    coupling: Number = described("Largest error of the map that joins two bodies.")
    displacement: Number = described("Largest displacement over the size of the body.")
    penetration: Number = described(
        "Deepest penetration; the regularised law allows pressure / gamma_n."
    )
    complementarity: Number = described("Largest product of pressure and distance.")
    stick_slip: Number = described(
        "Largest slip where the body sticks; the regularised law allows shear / gamma_t."
    )
    checked: float = described(
        "Tolerance of the conditions, relative to the stress of the softest piece."
    )
    law: str = described("The contact law of the check.")
    holds: bool


class ErrorBoundFigures(Row):
    """A guaranteed bound of the error."""

    relative_error: Number = perhaps(
        "Of the displacement, relative to the energy norm of the exact solution."
    )
    strain_energy: list[Number] = described(
        "Between which the strain energy of the exact solution is.", default_factory=list
    )
    error: Number = perhaps("Square root of a(e, e): at most the sum of the three that follow.")
    duality: Number = perhaps("Part of the gap between both functionals.")
    moved: Number = perhaps(
        "Part of the displacement without penetration instead of the computed one."
    )
    round_off: Number = perhaps("Part of round-off.")
    guaranteed: bool = perhaps("Whether it is a bound; else an estimate.")
    statement: str = described("All of it in a sentence, or why there is no bound.")


class PrintedNumber(Row):
    """A printed number with its error."""

    value: Number | Vector
    place: Vector | None = perhaps("Where it is, of a largest value.")
    error: Number = perhaps(
        "Half of the interval in which the value of the exact solution is expected; null: it is "
        "not known, or there is no finite value."
    )
    why: str | None = perhaps("Why it is not known, or is what it is.")

    def __str__(self) -> str:
        return self.told()

    def told(self, unit: str = "") -> str:
        """Return the number with its error and the reason, as text."""
        if self.error is None and self.why is not None and self.why.startswith(NO_FINITE_VALUE):
            return self.why
        text = f"{with_error(self.value, self.error)} {unit}".rstrip()
        return text if self.why is None else f"{text}{',' * (self.error != 0)} {self.why}"


class CostOfAccuracy(Row):
    """The cost of an accuracy: estimated error and seconds of this run, and the forecast for a
    smaller error.
    """

    of: str | None = perhaps(
        "The error that it is about, a column of the convergence table: `energy` is that of "
        "stress and displacement."
    )
    error: Number = perhaps("Estimated error of the last mesh, relative.")
    seconds: Number = perhaps("Wall time of all meshes together.")
    dofs: Count | None = perhaps("Unknowns of the last mesh.")
    next_error: Number = perhaps("A smaller error, relative: a tenth; nonlinear or in 3D a third.")
    next_seconds: list[Number] = described(
        "Wall time for that on this machine, from and to.", default_factory=list
    )
    next_dofs: Number = perhaps("About how many unknowns it would take.")
    command: str | None = perhaps(
        "Option for it, to be pasted behind the command or into `solve_to_accuracy`."
    )
    local: bool | None = perhaps("Whether cells become smaller only where the error is.")
    statement: str = described("All of it in a sentence, or why there is no forecast.")

    def __str__(self) -> str:
        return self.statement


def _with_components(schema: dict[str, Any]) -> None:
    """Allow further keys in the schema of steps: forces and motions by axis, followed by a space
    and the boundary if there are several contacts between bodies.
    """
    _closed(schema)
    schema["additionalProperties"] = {"type": ["number", "null"]}


class RowOfSteps(Row):
    """The results of one load step."""

    model_config = ConfigDict(json_schema_extra=_with_components)

    step: int = Field(ge=1)
    name: str = described("Its name; empty: it has none.")
    time: float = described("Its time.")
    status: str
    linear_solves: Count
    certificate_holds: bool
    max_pressure: Number = perhaps("Largest nodal pressure.", "stress")
    torque: Number = perhaps("Torque of friction about the axis x[1], with torsion.", "moment")
    friction_work: Number = perhaps("Energy dissipated by slip in this step.", "energy")
    strain_energy: Number = perhaps("a(y, y) / 2, in 2D per unit thickness.", "energy")
    kinetic_energy: Number = perhaps("Kinetic energy, with inertia.", "energy")
    contact_loss: Number = perhaps("Energy lost in contact in the last time step.", "energy")
    energy_error: Number = perhaps("What the energies of this time step miss, relative.")
    time_error: Number = perhaps(
        "Of all time steps so far, in displacement and tractions, relative, estimated."
    )


class Run(Row):
    """The keys of a summary about the run itself."""

    schema_version: Literal[1] = described(
        "Version of this schema: it grows when a key goes or changes its meaning, not when one is "
        "added."
    )
    title: str = described("The title of the scene.")
    incomplete: list[str] = described("Missing parts of the intended model, listed in the scene.")
    scene: dict[str, Any] = described(
        "The scene with all defaults; `signorini-fx schema` prints its schema. Python objects are "
        "given by the name of "
        "their type."
    )
    status: str = described("How the solve ended; only `converged` is a solution.")
    advice: str = described("What to do.")
    converged: bool = described("Whether this is a solution, certificate included.")
    algorithm: str = described("The algorithms that were used; `linear` without contact.")
    parameters: UsedParameters = described(
        "Parameters of the algorithms as they were used; `infinite` for those without limit."
    )
    iterations: Count = described("Linear solves without those that only compute a start.")
    linear_solves: Count = described("All linear solves.")
    factorisations: Count = described("New factorisations.")
    outer_iterations: Count = described("Regularised problems that were solved.")
    events: list[str] = described(
        "Fall-backs in the order of their use, and the meshes of a nested iteration."
    )
    dimension: Literal[2, 3] = described("2 in 2D, 3 in 3D.")
    dofs: Count = described("Displacement components, prescribed ones included.")
    ranks: int = described("MPI processes.", ge=1)
    linear_algebra: str = described("Kind of elastic system, and why.")
    pieces: list[PieceOfBody] = described("The connected pieces of the body.")
    findings: list[FindingRow] = described("Warnings and notes about the scene and the result.")
    convergence_table: list[Price] = perhaps(
        "Errors and costs of the meshes, if there are several."
    )
    results_of: StepOfResults = perhaps(
        "The load step that all other figures are of: the last one with a solution, or the first "
        "one if it has none."
    )
    timings: dict[str, Number] = described(
        "Wall time in seconds by phase, the largest over the ranks."
    )
    versions: dict[str, str] = described("Versions by library, and the BLAS in use.")
    finished: str = perhaps("When the results were written: date and time in UTC, ISO 8601.")
    fields: list[str] = perhaps("Names of the files of fields; absent if none were written.")


class Summary(Run):
    """All keys of summary.json: those about the run, and the results."""

    steps: list[RowOfSteps] = perhaps("The load steps, if there are several.")
    limit: LimitOfRamp = perhaps("Of a ramp that has ended before its loads are whole.")
    friction_used: Number = perhaps(
        "Share of its friction that the loads use, with the friction bounds of this solution."
    )
    contact_nodes: Count = perhaps("Nodes of the contact boundary.")
    touching_nodes: Count = perhaps("Those in contact.")
    contact_force: Vector = perhaps(
        "Resultant of the normal tractions on the body; of several contacts between bodies a sum "
        "that acts on none of "
        "them: see contact_boundaries.",
        "force",
    )
    friction_force: Vector = perhaps("The same of the tangential tractions.", "force")
    pressure_integral: Number = perhaps("Integral of the pressure.", "force")
    max_pressure: Number = perhaps(
        "Largest nodal pressure, of bodies at finite strains per area of the undeformed boundary.",
        "stress",
    )
    present_pressure: Number = perhaps(
        "The same per area of the displaced boundary, of scenes at finite strains.", "stress"
    )
    no_limit_of_pressure: str | None = perhaps(
        "Why and where the pressure has no limit as the mesh is refined; null: it has one, or "
        "nothing is proved."
    )
    max_shear: Number = perhaps("Largest nodal shear.", "stress")
    zones: ZoneRuns = perhaps("Zones on the contact boundary of a body in 2D.")
    areas: ZoneAreas = perhaps("Areas on the contact boundary of a body in 3D.", "area")
    contact_moment: Vector = perhaps(
        "Moment of `contact_force` about the origin, in 3D; with torsion about the axis x[1].",
        "moment",
    )
    friction_moment: Vector = perhaps(
        "Moment of `friction_force` about the origin, in 3D; with torsion about the axis x[1].",
        "moment",
    )
    contact_boundaries: list[ContactFigures] = perhaps(
        "Each contact boundary; areas are lengths in 2D."
    )
    corners: list[CornerFigures] = perhaps("Corners of foundations in contact between nodes.")
    rigid_bodies: list[RigidBody] = perhaps(
        "Rigid bodies that forces move: their motion, and the force of the body on them."
    )
    preloads: list[SectionForce] = perhaps("Sections that are tightened.")
    resultants: list[BoundaryResultant] = described(
        "Forces on the body through each boundary with a support, a load or contact, and the body "
        "force; in 2D "
        "per unit thickness."
    )
    strain_energy: Number = perhaps(
        "a(y, y) / 2, in 2D per unit thickness; of a body whose forces are linear in y.", "energy"
    )
    stress: StressExtremes = perhaps(
        "Extremes of the raw stress at the nodes, and of the recovered one; of nonlinear "
        "materials those of the Cauchy "
        "stress at the points of quadrature; absent if no fields were written.",
        "stress",
    )
    plastic_strain: ExtremeOfValue = perhaps(
        "Largest accumulated (equivalent) plastic strain at the points of quadrature, and where; "
        "absent if no material "
        "is one that yields, or no fields were written."
    )
    utilisation: ExtremeOfValue = perhaps(
        "Largest von Mises stress over the yield stress, and where; absent if no material has a "
        "yield stress."
    )
    deformation: LargestDeformation = described("Of the load step with the largest one.")
    certificate: CertificateFigures = described(
        "The check of the conditions of the problem; every figure is relative."
    )
    error_bound: ErrorBoundFigures = perhaps(
        "A guaranteed bound of the error in the energy norm, with `error_bound = true`."
    )
    cost: CostOfAccuracy = perhaps("Cost of this accuracy, and the forecast for a better one.")
    numbers: dict[str, PrintedNumber] = perhaps("Errors of the numbers that are printed, by name.")


@dataclass(frozen=True)
class Results:
    """The content of a result folder.

    Attributes:
        path: the folder.
        summary: summary.json, with each key as an attribute, also in rows of lists; None: the key
            is absent. Quantities that are not installed are kept as they are in the file.
    """

    path: Path
    summary: Summary

    @property
    def tables(self) -> tuple[str, ...]:
        """The names of the tables, such as ``contact``."""
        return tuple(sorted(file.stem for file in self.path.glob("*.csv")))

    def table(self, name: str) -> dict[str, Any]:
        """Return the columns of a table as arrays.

        Raises:
            ResultError: there is no such table, or it cannot be read.
        """
        if name not in self.tables:
            raise ResultError(
                f"{self.path}: has no table {name!r}; there are: {', '.join(self.tables)}"
            )
        try:
            return read_csv(self.path / f"{name}.csv")
        except (OSError, ValueError) as error:
            raise ResultError(f"{self.path}: {name}.csv cannot be read: {error}") from None

    def to_dataframe(self, name: str) -> DataFrame:
        """Return a table as a ``pandas.DataFrame``, see ``table``."""
        return dataframe(self.table(name))


def read_results(folder: str | os.PathLike[str]) -> Results:
    """Read a result folder.

    Raises:
        ResultError: it is not a result folder, or its summary does not have the format that
            ``solve`` writes.

    Examples:
        >>> import tempfile
        >>> folder = tempfile.mkdtemp() + "/block"
        >>> _ = sfx.write_results(solution, folder, fields=False, pictures=False)
        >>> print(np.round(sfx.read_results(folder).summary.contact_force, 6))
        [0. 4.]
    """
    path = folder_path(folder)
    summary = read_summary(path)
    try:
        return Results(path, Summary.model_validate(summary))
    except ValidationError as error:
        first = error.errors()[0]
        key = ".".join(map(str, first["loc"]))
        raise ResultError(
            f"{path}: summary.json is not what solve writes: {key}: {first['msg']}: solve again"
        ) from None


class Quantity:
    """A result of your own: derive a class that sets ``key`` and ``title`` and defines ``value``.

    It appears in summary.json, on the terminal, in the report, and in steps.csv if it is a number.

    Attributes:
        key: its name in summary.json.
        title: its description.
        unit: what it is measured in, a key of ``units.names_of`` such as ``force``; "": it has no
            unit.

    Examples:
        >>> class Peak(sfx.Quantity):
        ...     key, title, unit = "peak", "Largest pressure.", "stress"
        ...
        ...     def value(self, solution):
        ...         return float(solution.table.columns["pressure"].max())
        >>> print(round(Peak().value(solution), 6))
        2.0
    """

    key: str
    title: str
    unit: str = ""

    def value(self, solution: Any) -> float | list[float] | None:
        """Return a number or a list of numbers; None if the solution has none; collective.

        Args:
            solution: a ``Solution``, of a load step if there are several.
        """
        raise NotImplementedError


def own_quantities() -> tuple[Quantity, ...]:
    """Return the quantities of other packages that are installed or registered.

    Raises:
        InstallationError: one of them cannot be used.
    """
    return tuple(_usable(name, load(QUANTITIES, name)) for name in names_of(QUANTITIES))


@cache
def _usable(name: str, extension: Any) -> Quantity:
    """Return a quantity from an object, or from a class that needs no arguments.

    Raises:
        InstallationError: it is no quantity, or its key is not its name or is taken already.
    """
    quantity = extension() if isinstance(extension, type) else extension
    if not isinstance(quantity, Quantity) or not isinstance(getattr(quantity, "title", None), str):
        raise InstallationError(
            f"the quantity {name!r} is no signorini_fx.Quantity with a key and a title"
        )
    taken = {*Summary.model_fields, *RowOfSteps.model_fields}
    if getattr(quantity, "key", None) != name or not name.isidentifier() or name in taken:
        raise InstallationError(
            f"the quantity {name!r} needs a key that is its name, an identifier that is not taken"
        )
    return quantity
