"""The types that values have in summary.json."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

from pydantic import BaseModel, ConfigDict, Field
from typing_extensions import TypeAliasType


class Row(BaseModel):
    """A table of a summary, such as a row of a list; what a later version adds to it is kept when it is read."""

    model_config = ConfigDict(extra="allow", frozen=True, defer_build=True)


def described(text: str, **limits: Any) -> Any:
    """A key that is always there; ``text`` says what it means."""
    return Field(description=text, **limits)


def perhaps() -> Any:
    """A key that may be absent."""
    return Field(default=None)


if TYPE_CHECKING:
    Number = float | None
    Vector = list[float | None]
    Point = list[float | None]
else:
    Number = TypeAliasType("number", float | None)
    Vector = TypeAliasType("vector", Annotated[list[Number], Field(min_length=2, max_length=3)])
    Point = TypeAliasType("point", Annotated[list[Number], Field(min_length=2, max_length=3)])
Count = Annotated[int, Field(ge=0)]


class ExtremeOfStress(Row):
    """A value and where it is."""

    value: Number
    place: Annotated[list[Number], Field(max_length=3)]
    region: str | None = described(
        "Name of its body or of the region of its material, if there are several; null: that without a region.",
        default=None,
    )
    no_limit: str | None = described(
        "Why it has no limit as the mesh is refined, if it is known to have none.", default=None
    )


# What the definitions of the schema say.
DESCRIPTIONS = {
    "number": "Null where a solve that failed could not compute it.",
    "vector": "Along the axes of the plane or of space.",
    "point": "Coordinates, lengths.",
}
