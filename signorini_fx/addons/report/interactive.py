"""Curves to zoom into and to read off, by dygraphs where the machine that makes the page has it.

The library goes into the page itself, which then still needs no network.  Without the library, without JavaScript and
in print there are the pictures, which are always in the page too.
"""

from __future__ import annotations

import itertools
import json
import sys
from collections.abc import Sequence
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from signorini_fx.addons.pictures.boundary_profiles import SIDES, STATES, Panel, PlaneBoundary, panels_of
from signorini_fx.addons.pictures.result_pictures import TURNING
from signorini_fx.addons.report.markup import script, tag
from signorini_fx.addons.report.templating import Markup
from signorini_fx.machine.result_files import ResultFiles
from signorini_fx.mechanics.statement.units import bracketed

# Where Debian's libjs-dygraphs and others put it.
_PLACES = tuple(Path(root) / "share/javascript/dygraphs" for root in dict.fromkeys(("/usr", sys.prefix)))
_MOST_NODES = 20_000  # of a page: about 2 MB
_DIGITS = 6
_MAIN = "#1a1a1a"


def library() -> Path | None:
    """The folder of dygraphs; None if this machine does not have it."""
    files = ("dygraph.min.js", "dygraph.min.css")
    return next((folder for folder in _PLACES if all((folder / name).is_file() for name in files)), None)


def head() -> list[Markup]:
    """Library, its licence and our own script, for the head of a page with plots; nothing without the library."""
    folder = library()
    if folder is None:
        return []
    files = resources.files("signorini_fx.addons.report")
    licence = files.joinpath("dygraphs_licence.txt").read_text(encoding="utf-8")
    code, style = ((folder / f"dygraph.min.{kind}").read_text(encoding="utf-8") for kind in ("js", "css"))
    # A reference to a file beside it would be looked up on the network.
    code, style = (text.rpartition("/*# sourceMappingURL")[0] or text for text in (code, style))
    code = code.rpartition("\n//# sourceMappingURL")[0] or code
    plotting = files.joinpath("report.js").read_text(encoding="utf-8")
    return [
        tag("style", Markup(style)),
        script(f"/* dygraphs\n{licence}*/\n{code}"),
        script(f'document.addEventListener("DOMContentLoaded", function () {{\n{plotting}}});'),
    ]


def plots(boundaries: Sequence[PlaneBoundary]) -> list[Markup]:
    """A place for the plots of each boundary, with their data; nothing without the library."""
    if library() is None or sum(len(boundary.coordinate) for boundary in boundaries) > _MOST_NODES:
        return []
    parts = []
    for boundary in boundaries:
        name = [tag("p", tag("strong", boundary.name))] if len(boundaries) > 1 else []
        data = json.dumps(_data(boundary), separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
        parts.append(tag("div", *name, script(data, type="application/json"), class_="plots", hidden="hidden"))
    hint = "Drag across a curve to enlarge that part; the values under the pointer stand above the curves."
    return [*parts, tag("p", hint, class_="note hint", hidden="hidden")]


def turning(folder: ResultFiles) -> list[Markup]:
    """A place for a body in 3D that can be turned, with its data and the script; nothing where solve wrote none."""
    data = folder.picture(TURNING)
    if data is None:
        return []
    body = json.loads(data)
    if not {"body", "grounds", "limits", "colours", "label", "factor", "largest"} <= set(body):
        raise ValueError(f"{TURNING} is not of this kind")
    text = json.dumps(body, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
    code = resources.files("signorini_fx.addons.report").joinpath("body_view.js").read_text(encoding="utf-8")
    hint = "Drag to turn, turn the wheel to come closer, drag with the right button or with shift to move."
    element = tag("div", script(text, type="application/json"), class_="turn", hidden="hidden")
    start = f'document.addEventListener("DOMContentLoaded", function () {{\n{code}}});'
    return [element, tag("p", hint, class_="note hint"), script(start)]


def _data(boundary: PlaneBoundary) -> dict[str, Any]:
    """What report.js draws: coordinates that increase, panels with rows, colours of the states."""
    order, breaks = _increasing(boundary)
    x = boundary.coordinate[order]
    sides = SIDES if boundary.has_friction else SIDES[:1]
    panels = [panel for side in sides for panel in panels_of(boundary, side)]
    return {
        "x": boundary.label.replace("$", ""),
        "window": boundary.window,
        "panels": [_panel(panel, x, order, breaks) for panel in panels],
        "states": _states(boundary, x, order, breaks),
        "key": [[*_in_html(name)] for name in STATES if name in boundary.states],
    }


def _in_html(state: str) -> tuple[str, str]:
    """Colour of a state, and its name without mathtext."""
    colour, name = STATES[state]
    return colour, name.replace("$", "").replace("-", "\N{MINUS SIGN}")


def _increasing(boundary: PlaneBoundary) -> tuple[npt.NDArray[np.int64], list[int]]:
    """Rows in the order of the coordinate, piece by piece, and where a new piece begins in it."""
    ends = [*boundary.starts[1:], len(boundary.coordinate)]
    pieces = [
        first + np.argsort(boundary.coordinate[first:end], kind="stable")
        for first, end in zip(boundary.starts, ends, strict=True)
    ]
    pieces.sort(key=lambda piece: float(boundary.coordinate[piece[0]]))
    return np.concatenate(pieces), list(np.cumsum([len(piece) for piece in pieces])[:-1])


def _panel(panel: Panel, x: Any, order: Any, breaks: list[int]) -> dict[str, Any]:
    values = [_numbers(curve.values[order]) for curve in panel.curves]
    rows = [list(row) for row in zip(_numbers(x), *values, strict=True)]
    for index in reversed(breaks):  # an empty row interrupts the lines
        rows.insert(index, [0.5 * (rows[index - 1][0] + rows[index][0]), *[None] * len(values)])
    return {
        "unit": f"{panel.unit}{bracketed(panel.unit)}",
        "names": [curve.name for curve in panel.curves],
        "colours": [curve.style.get("color", _MAIN) for curve in panel.curves],
        "dashes": [_dashes(curve.style.get("linestyle")) for curve in panel.curves],
        "rows": rows,
        "range": panel.limits,
    }


def _numbers(values: Any) -> list[float | None]:
    return [float(f"{value:.{_DIGITS}g}") if np.isfinite(value) else None for value in values]


def _dashes(style: Any) -> list[float] | None:
    """The strokes of a line style of matplotlib, in pixels."""
    return [2 * stroke for stroke in style[1]] if isinstance(style, tuple) else None


def _states(boundary: PlaneBoundary, x: Any, order: Any, breaks: list[int]) -> list[list[Any]]:
    """From where to where the boundary has which colour: each node up to halfway to its neighbours."""
    states = np.array(boundary.states)[order]
    stretches: list[list[Any]] = []
    for first, end in itertools.pairwise([0, *breaks, len(x)]):
        at = x[first:end]
        borders = np.concatenate((at[:1], 0.5 * (at[1:] + at[:-1]), at[-1:]))
        changes = np.flatnonzero(states[first + 1 : end] != states[first : end - 1]) + 1
        for start, stop in itertools.pairwise([0, *changes, end - first]):
            colour = STATES[str(states[first + start])][0]
            stretches.append([*_numbers(borders[[start, stop]]), colour])
    return stretches
