"""What summary.json says of a run beside its quantities, as models from which its schema is made."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field

from signorini_fx.quantities.kinds import Count, Number, Point, Row, described

Setting = Number | Literal["infinite"]


class UsedParameters(Row):
    """Parameters of the algorithms as they were used; `infinite` for those without limit."""

    gamma_n: Setting = None
    gamma_t: Setting = None
    sigma: Setting = None
    regularisation_error: Setting = None


class PieceOfBody(Row):
    """A piece."""

    piece: Count
    body: str | None = described("The body of a scene with several that it is of.")
    cells: Count
    bounds: Annotated[list[Point], Field(min_length=2, max_length=2)]
    joined_to: list[Count] = described("Pieces that a hinge joins it to.")


class FindingRow(Row):
    """A finding."""

    level: Literal["warning", "note"]
    path: str = described("Key of the scene that it concerns.")
    message: str


class PriceOfMesh(Row):
    """A mesh."""

    level: Count
    dofs: Count
    h: Number
    linear_solves: Number
    factorisations: Number
    seconds: Number
    memory: Number
    energy: Number
    pressure: Number
    force: Number
    zone: Number
    peak: Number
    regularisation: Number
    iteration: Number
    predicted: bool = described("Whether this is a prediction for the next mesh.")


class StepOfResults(Row):
    """A load step."""

    step: int = Field(ge=1)
    name: str
    time: float
    status: str


class RowOfSteps(Row):
    """A load step."""

    step: int = Field(ge=1)
    name: str = described("Its name; empty: it has none.")
    time: float = described("Its time.")
    status: str
    linear_solves: Count
    certificate_holds: bool


class Run(Row):
    """Of a solve."""

    schema_version: Literal[1] = described(
        "Version of this schema: it grows when a key goes or changes its meaning, not when one is added."
    )
    title: str = described("The title of the scene.")
    incomplete: list[str] = described("What the scene lacks of what was meant, as the scene says it.")
    scene: dict[str, Any] = described(
        "The scene with all defaults; `signorini-fx schema` prints its schema. Python objects are given by the name of "
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
    outer_iterations: Count = described("Regularised problems.")
    events: list[str] = described("Fall-backs in the order of their use, and the meshes of a nested iteration.")
    dimension: Literal[2, 3] = described("2 in 2D, 3 in 3D.")
    dofs: Count = described("Displacement components, prescribed ones included.")
    ranks: int = described("MPI processes.", ge=1)
    linear_algebra: str = described("Kind of elastic system, and why.")
    pieces: list[PieceOfBody] = described("The connected pieces of the body.")
    findings: list[FindingRow] = described("What is to be known about the scene and the result.")
    convergence_table: list[PriceOfMesh] = described(
        "Errors and costs of the meshes, if there are several.", default=None
    )
    results_of: StepOfResults = described(
        "The load step that all other figures are of: the last one with a solution, or the first one if it has none.",
        default=None,
    )
    steps: list[RowOfSteps] = described("The load steps, if there are several.", default=None)
    compiled: list[str] = described("Names of the compiled forms.")
    timings: dict[str, Number] = described("Wall time in seconds by phase, the largest over the ranks.")
    versions: dict[str, str] = described("Versions by library, and the BLAS in use.")
    finished: str = described("When the results were written: date and time in UTC, ISO 8601.", default=None)
    fields: list[str] = described("Names of the files of fields; absent if none were written.", default=None)
