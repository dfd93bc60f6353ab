"""The pictures of a result: data from all ranks, drawn on the first one."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from signorini_fx import parallel
from signorini_fx.contact.table import ContactTable
from signorini_fx.records import as_rows
from signorini_fx.report.fields import FIELDS, values_of
from signorini_fx.results.solution import Solution

if TYPE_CHECKING:
    from signorini_fx.report.moving_body import Moment
    from signorini_fx.report.solid_foundation import FoundationSurface
    from signorini_fx.report.tiling import Tiling
    from signorini_fx.results.body_cells import GatheredCells
    from signorini_fx.results.outer_surface import OuterSurface


@dataclass(frozen=True)
class BodyPictures:
    """What the pictures of a solution are made from.

    Attributes:
        fields: names of the fields that are drawn on the body, the von Mises stress first.
        cells: of a body in the plane.
        surface: of a body in space; None too if it has too many facets.
        moments: the body at each of several load steps, for an animation.
    """

    fields: tuple[str, ...]
    cells: GatheredCells | None = None
    surface: OuterSurface | None = None
    moments: Sequence[Moment] = ()

    @classmethod
    def gathered(cls, solution: Solution, asked: Sequence[str] = ()) -> BodyPictures:
        """Of a solution, with fields beside the von Mises stress; collective."""
        fields = tuple(dict.fromkeys(("von_mises", *asked)))
        if solution.discretisation.tagged.dimension == 2:
            from signorini_fx.results.body_cells import gather_cells

            cells = gather_cells(solution, fields, recovered=True)
            return cls(fields, cells=cells, moments=_moments(solution, gather_cells))
        from signorini_fx.report.solid_body import MOST_FACETS
        from signorini_fx.results.outer_surface import gather_outer_surface, outer_facets

        count = outer_facets(solution)
        if count <= MOST_FACETS:
            moments = _moments(solution, gather_outer_surface)
            return cls(fields, surface=gather_outer_surface(solution, fields, recovered=True), moments=moments)
        parallel.log_on_root(
            solution.comm,
            f"the deformed body is not drawn: its surface has {count} facets, more than {MOST_FACETS}: "
            "see it in ParaView",
        )
        return cls(fields)

    def draw(self, solution: Solution, table: ContactTable | None, folder: Path) -> None:
        """All pictures, into a folder; on the first rank."""
        # matplotlib takes a while to import
        from signorini_fx.report.style import plain

        title = plain(solution.scene.title)
        if self.cells is not None:
            self._draw_in_the_plane(self.cells, table, folder, title)
        else:
            self._draw_in_space(table, folder, title)
        _draw_course(solution, folder)

    def _draw_in_the_plane(self, cells: GatheredCells, table: ContactTable | None, folder: Path, title: str) -> None:
        from signorini_fx.report.boundary_profiles import boundary_profiles
        from signorini_fx.report.deformed_body import Foundation, deformed_mesh

        foundation = None
        if table is not None:
            c = table.columns
            offset = np.column_stack((c["n_x"], c["n_y"])) * c["gap"][:, None]
            foundation = Foundation(np.column_stack((c["x"], c["y"])), offset, c["state"] != "open")
        polygons, tiles = _polygons(cells)
        for name in self.fields:
            deformed_mesh(
                folder / _stem(name),
                cells.points,
                polygons,
                cells.displacement,
                values_of(name, cells.values),
                outline=cells.outline,
                tiles=tiles,
                field=FIELDS[name],
                stress=_in_the_middle(cells) if name == "principal" else None,
                foundation=foundation,
                title=title,
            )
        if self.moments:
            from signorini_fx.report.moving_body import moving_body

            moving_body(
                folder / "deformed.gif",
                cells.points,
                polygons,
                self.moments,
                tiles=tiles,
                outline=cells.outline,
                foundation=foundation,
                title=title,
            )
        if table is not None:
            boundary_profiles(folder / "profiles", table.columns, title=title)

    def _draw_in_space(self, table: ContactTable | None, folder: Path, title: str) -> None:
        from signorini_fx.report.contact_surface import contact_surface
        from signorini_fx.report.reading import read_facets
        from signorini_fx.report.solid_body import deformed_solid, telling_view

        facets = None if table is None else read_facets(folder / "contact.vtu")
        foundations = [] if table is None or facets is None else foundations_of(table.columns, facets)
        if self.surface is not None:
            body = self.surface
            polygons, tiles = _polygons(body)
            seen = telling_view(body.points, polygons, values_of("von_mises", body.values), tiles)
            for name in self.fields:
                deformed_solid(
                    folder / _stem(name),
                    body.points,
                    polygons,
                    body.displacement,
                    values_of(name, body.values),
                    tiles=tiles,
                    field=FIELDS[name],
                    stress=_in_the_middle(body) if name == "principal" else None,
                    foundations=foundations,
                    seen=seen,
                    title=title,
                )
            if self.moments:
                from signorini_fx.report.moving_body import moving_body

                moving_body(
                    folder / "deformed.gif",
                    body.points,
                    polygons,
                    self.moments,
                    tiles=tiles,
                    foundations=foundations,
                    title=title,
                )
        if table is not None and facets is not None:
            contact_surface(folder / "contact_surface", table.columns, facets, title=title)


def _moments(solution: Solution, gather: Callable[..., GatheredCells | OuterSurface]) -> list[Moment]:
    """The body at the load steps that an animation shows, none if there is only one; collective."""
    steps = solution.shown_steps
    if len(steps) < 2:
        return []
    from signorini_fx.report.moving_body import Moment, shown

    found = []
    for step in (steps[k] for k in shown(len(steps))):
        then = solution.at(step)
        body = gather(then, ("von_mises",), recovered=True)
        touching = None if then.contact is None else then.table.columns["state"] != "open"
        found.append(Moment(str(step), body.displacement, body.values["von_mises"], touching))
    return found


def _polygons(body: GatheredCells | OuterSurface) -> tuple[npt.NDArray[np.int64], Tiling | None]:
    """The points of each cell or facet, and how it is divided, if there are values at points."""
    return (body.within, body.tiles) if body.recovered else (body.within[:, : body.tiles.rim], None)


def _in_the_middle(body: GatheredCells | OuterSurface) -> npt.NDArray[np.float64]:
    """The stress at the midpoint of each cell or facet, shape (m, 3, 3)."""
    stress = body.values["stress"]
    return np.asarray(stress[:, body.tiles.vertices].mean(axis=1)) if body.recovered else stress


def draw_load_steps(folder: Path) -> None:
    """The forces step by step, from the table of the result folder."""
    from signorini_fx.report.load_steps import load_steps
    from signorini_fx.report.reading import read_csv

    load_steps(folder / "load_steps", read_csv(folder / "steps.csv"))


def _stem(field: str) -> str:
    return "deformed" if field == "von_mises" else f"field_{field}"


def _draw_course(solution: Solution, folder: Path) -> None:
    """The convergence history, and the prices of the meshes."""
    from signorini_fx.report.convergence import errors_and_costs, iteration_history
    from signorini_fx.report.style import plain

    dimension = solution.discretisation.tagged.dimension
    if solution.history.iterations:
        iteration_history(folder / "history", as_rows(solution.history.iterations), dimension=dimension)
    if solution.price_list:
        errors_and_costs(folder / "price_list", as_rows(solution.price_list), title=plain(solution.scene.title))


def foundations_of(c: Mapping[str, Any], facets: npt.NDArray[np.int64]) -> list[FoundationSurface]:
    """The foundation of each contact boundary in space; ``facets`` are rows of the contact table, shape (m, k)."""
    from signorini_fx.report.solid_foundation import FoundationSurface

    nodes, normals = (np.column_stack([c[f"{name}{axis}"] for axis in "xyz"]) for name in ("", "n_"))
    gap = np.asarray(c["gap"])
    corners = facets[:, :4]  # VTK's biquadratic facets begin with their corners
    found = []
    for name in dict.fromkeys(c["boundary"]):
        here = np.asarray(c["boundary"] == name)
        row = np.cumsum(here) - 1
        found.append(FoundationSurface(nodes[here], normals[here], gap[here], row[corners[here[corners].all(axis=1)]]))
    return found
