"""A result folder as one page of HTML that needs nothing else: no network, no other file, no script.

It is made from what ``solve`` wrote, without dolfinx: curves are drawn again from the CSV files as SVG, the deformed
body is the picture that ``solve`` drew.  Every text passes ``tag``, which escapes all that is not made by ``tag``.
"""

from __future__ import annotations

import base64
import contextlib
import html
import json
import math
import os
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from importlib import resources
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np

from signorini_fx import __version__
from signorini_fx.errors import OutputError, ResultError
from signorini_fx.records import CERTIFICATE_TOLERANCE, FEW_NODES, Status
from signorini_fx.report.pyvista_pictures import FIELDS

PAGE = "report.html"
_LONG = 40  # rows from which on a table is folded
_WIDE_TABLE = 8  # columns from which on print takes small letters
_WIDE_CELL = 16  # letters from which on a cell is broken into lines
_LARGEST_SUMMARY = 100_000_000  # bytes; it grows with the load steps only
_MOST_ROWS = 400  # of a table; the CSV file has all
_VOID = frozenset({"br", "img", "meta"})

# Every figure of the certificate: its limit, None where it is reported only, and its meaning.
JUDGED: dict[str, tuple[float | None, str]] = {
    "equilibrium": (CERTIFICATE_TOLERANCE, "forces out of balance, contact tractions included"),
    "supports": (CERTIFICATE_TOLERANCE, "largest difference from a prescribed displacement"),
    "negative_pressure": (CERTIFICATE_TOLERANCE, "largest tension that the contact transmits"),
    "friction_cone": (CERTIFICATE_TOLERANCE, "largest shear beyond the friction bound"),
    "wrong_way_slip": (CERTIFICATE_TOLERANCE, "slip in the direction of the friction force"),
    "entered": (CERTIFICATE_TOLERANCE, "deepest penetration beyond what the law allows for"),
    "pressure_at_distance": (CERTIFICATE_TOLERANCE, "largest pressure where there is a distance"),
    "slip_below_bound": (CERTIFICATE_TOLERANCE, "largest slip where the shear is below its bound"),
    "displacement": (None, "largest displacement over the size of the body"),
    "penetration": (None, "deepest penetration; the regularised law allows pressure / gamma_n"),
    "complementarity": (None, "largest product of pressure and distance"),
    "stick_slip": (None, "largest slip where the body sticks; the regularised law allows shear / gamma_t"),
}


# --- markup ----------------------------------------------------------------------------------------------------------


class Markup(str):
    """Text that is HTML already."""

    __slots__ = ()


def tag(name: str, *children: str, **attributes: str) -> Markup:
    """An element; children and values of attributes are escaped unless they are markup (``class_`` means class)."""
    said = {key.rstrip("_"): value for key, value in attributes.items() if value or key != "class_"}
    given = "".join(f' {key}="{html.escape(value)}"' for key, value in said.items())
    if name in _VOID:
        return Markup(f"<{name}{given}>")
    return Markup(f"<{name}{given}>{joined(children)}</{name}>")


def joined(parts: Iterable[str]) -> Markup:
    """One after the other, escaped unless they are markup."""
    return Markup("".join(part if isinstance(part, Markup) else html.escape(part, quote=False) for part in parts))


def shown(value: Any) -> str:
    """A value of a table."""
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return ""
    if isinstance(value, str):
        return value
    if isinstance(value, bool | np.bool_):
        return "yes" if value else "no"
    if isinstance(value, float | np.floating):
        return f"{value + 0.0:.6g}"
    if isinstance(value, list | tuple):
        return f"({', '.join(map(shown, value))})"
    if isinstance(value, Mapping):
        return ", ".join(f"{key} = {shown(item)}" for key, item in value.items() if item is not None)
    return str(value)


def _is_number(value: Any) -> bool:
    return value is None or (isinstance(value, int | float | np.number) and not isinstance(value, bool))


def table(columns: Sequence[str], rows: Sequence[Sequence[Any]], classes: Sequence[str] = ()) -> Markup:
    """A table that scrolls sideways where it is wider than the page; columns of numbers are flush right."""
    numeric = [all(_is_number(row[k]) for row in rows) for k in range(len(columns))]
    head = [tag("th", name, class_="number" if right else "") for name, right in zip(columns, numeric, strict=True)]
    body = []
    for row, class_ in zip(rows, classes or [""] * len(rows), strict=True):
        cells = []
        for value, right in zip(row, numeric, strict=True):
            text = shown(value)
            cells.append(tag("td", text, class_="number" if right else "words" if len(text) > _WIDE_CELL else ""))
        body.append(tag("tr", *cells, class_=class_))
    size = "wide" if len(columns) > _WIDE_TABLE else ""
    whole = tag("table", tag("thead", tag("tr", *head)), tag("tbody", *body), class_=size)
    return tag("div", whole, class_="scroll", tabindex="0")


def _long_table(title: str, columns: Mapping[str, Any], file: str) -> Markup:
    """Columns of a CSV file; a long table is folded, a very long one shows its two ends."""
    rows = list(zip(*columns.values(), strict=True))
    remark: list[Markup] = []
    if len(rows) > _MOST_ROWS:
        half = _MOST_ROWS // 2
        text = f"The first and the last {half} of {len(rows)} rows; {file} has all."
        remark, rows = [tag("p", text, class_="note")], [*rows[:half], *rows[-half:]]
    names = [name.replace("_", " ") for name in columns]
    summary = tag("summary", f"{title}, {len(rows)} row{'s' * (len(rows) != 1)}")
    return tag("details", summary, *remark, table(names, rows), **({"open": ""} if len(rows) <= _LONG else {}))


def _picture(data: bytes, kind: str, alternative: str, caption: str, class_: str = "still") -> Markup:
    source = f"data:image/{kind};base64,{base64.b64encode(data).decode('ascii')}"
    return tag("figure", tag("img", src=source, alt=alternative), tag("figcaption", caption), class_=class_)


# --- what solve wrote ------------------------------------------------------------------------------------------------


def read_summary(folder: Path) -> dict[str, Any]:
    """summary.json of a result folder.

    Raises:
        ResultError: the folder is not there, no result folder, or half written.
    """
    file = folder / "summary.json"
    if not os.path.isdir(folder):  # a name may be of any length
        what = "is a file" if os.path.exists(folder) else "is not there"
        raise ResultError(f"{folder}: {what}: give the folder that signorini-fx solve wrote, such as results/NAME")
    if not file.is_file():
        begun = any((folder / name).exists() for name in (".part", "history.csv", "contact.csv"))
        what = "is half written, it has no summary.json yet: let solve finish, or solve again"
        raise ResultError(f"{folder}: {what if begun else 'is no result folder, it has no summary.json'}")
    try:
        if file.stat().st_size > _LARGEST_SUMMARY:
            raise ResultError(f"{file}: is longer than what signorini-fx solve writes: give a folder that it wrote")
        summary = json.loads(file.read_text(encoding="utf-8"))
    except RecursionError:
        raise ResultError(f"{file}: cannot be read: nested too deeply: solve again") from None
    except (OSError, ValueError) as error:
        raise ResultError(f"{file}: cannot be read: {error}: solve again") from None
    if not isinstance(summary, dict) or not {"status", "certificate", "scene", "linear_solves"} <= set(summary):
        raise ResultError(f"{file}: is not what signorini-fx solve writes: give a folder that it wrote")
    if summary.get("dimension") == 3:
        raise ResultError(f"{folder}: is of a body in space, which has no page yet: open contact.vtu in ParaView")
    return summary


class _Folder:
    """The files of a result folder and the pictures made of them."""

    def __init__(self, folder: Path) -> None:
        self.path = folder

    def columns(self, name: str, rows: int | None = None) -> dict[str, Any]:
        """The columns of a CSV file; with so many rows, if it is known how many.

        Raises:
            ValueError: it has another number of rows.
        """
        from signorini_fx.report.plots import read_csv

        found = read_csv(self.path / name)
        count = len(next(iter(found.values()), ()))
        if rows is not None and count != rows:
            raise ValueError(f"{name} has {count} rows, {rows} are wanted")
        return found

    def picture(self, name: str) -> bytes | None:
        """A picture that solve drew, None if it drew none."""
        file = self.path / name
        return file.read_bytes() if file.is_file() else None


def _drawn(suffix: str, draw: Any, *arguments: Any, **options: Any) -> bytes:
    """The file that a function of ``plots`` writes."""
    with tempfile.TemporaryDirectory() as folder:
        if suffix == ".svg":
            draw(Path(folder) / "picture", *arguments, suffixes=[suffix], **options)
        else:
            draw(Path(folder) / f"picture{suffix}", *arguments, **options)
        return (Path(folder) / f"picture{suffix}").read_bytes()


# --- sections --------------------------------------------------------------------------------------------------------


# A solution, less accurate than asked for.
_SHORT_OF_ACCURACY = (Status.BUDGET.value, Status.OUT_OF_REACH.value)


def _outcome(summary: dict[str, Any]) -> Markup:
    good = summary["status"] == Status.CONVERGED.value
    short = summary["status"] in _SHORT_OF_ACCURACY
    verdict = "The certificate holds." if summary["certificate"]["holds"] else "The certificate does NOT hold."
    if not good:
        last = "the last mesh" if short else "the last iterate: to look at, not to use"
        verdict = f"{verdict} All figures are of {last}."
    if not good and summary["linear_solves"] == 0:
        verdict += " Nothing had to be solved to tell: it is the body without displacement."
    text = [tag("strong", summary["status"]), tag("p", verdict)]
    if not good:
        text.append(tag("p", f"What to do: {summary['advice']}."))
    status = tag("div", *text, class_=f"status {'good' if good else 'short' if short else 'bad'}")
    warned = _findings(summary, "warning")
    names = {
        "contact_force": "contact force on the body",
        "friction_force": "friction force on the body",
        "max_pressure": "largest contact pressure",
        "max_shear": "largest shear",
        "strain_energy": "strain energy",
        "dofs": "unknowns",
        "contact_nodes": "contact nodes",
        "linear_solves": "linear solves",
    }
    largest = max((abs(f) for key in ("contact_force", "friction_force") for f in summary.get(key, [])), default=0.0)
    figures = [(label, shown(_clean(summary[key], largest))) for key, label in names.items() if key in summary]
    figures.append(("seconds", f"{sum(summary['timings'].values()):.3g}"))
    cards = [tag("div", tag("dt", label), tag("dd", value)) for label, value in figures]
    note = "Forces are per unit thickness, and what the foundation exerts on the body; units are those of the scene."
    return joined([status, *warned, tag("dl", *cards, class_="figures"), tag("p", note, class_="note")])


def _findings(summary: dict[str, Any], level: str) -> list[Markup]:
    """What the solver has found about the scene and the result, empty where there is nothing of that level."""
    found = [finding for finding in summary.get("findings", []) if finding["level"] == level]
    items = [tag("li", tag("code", finding["path"]), f": {finding['message']}.") for finding in found]
    return [tag("p", f"{level.capitalize()}s:"), tag("ul", *items)] if items else []


def _clean(value: Any, scale: float) -> Any:
    """Components of a vector that are round-off beside the scale are zero; a single number stays."""
    return [c if abs(c) > 1e-9 * scale else 0.0 for c in value] if isinstance(value, list) else value


def _certificate(summary: dict[str, Any]) -> Markup:
    rows, classes = [], []
    for name, value in summary["certificate"].items():
        if name in ("holds", "law"):
            continue
        limit, meaning = JUDGED.get(name, (None, ""))
        missed = limit is not None and not (_is_number(value) and value <= limit)
        verdict = "reported" if limit is None else "violated" if missed else "holds"
        judged = "" if limit is None else f"<= {limit:g}"
        rows.append((_named(name.replace("_", " "), meaning), _short(value), verdict, judged))
        classes.append("missed" if missed else "")
    law = f" Judged by {summary['certificate']['law']}." if "law" in summary["certificate"] else ""
    note = (
        "The conditions of the problem, checked anew after the iteration from the displacement and the contact "
        f"tractions alone.{law} Every figure is relative: to the largest stress, deformation or force."
    )
    parts = [tag("p", note, class_="note"), table(["figure", "value", "", "limit"], rows, classes)]
    if "functionals" in summary:
        gap = summary["functionals"]["relative_duality_gap"]
        parts.append(tag("p", f"Primal and dual functional differ by {gap:.1e}, relative."))
    return joined(parts)


def _scene(summary: dict[str, Any]) -> Markup:
    scene = summary["scene"]
    mesh = scene["mesh"]
    rows: list[tuple[str, str]] = []
    if isinstance(mesh, dict) and "generator" in mesh:
        rows.append((_named("mesh", mesh["generator"]), shown(mesh["parameters"])))
    else:
        said = {key: value for key, value in mesh.items() if value} if isinstance(mesh, dict) else {}
        rows.append(("mesh", shown(said) or "made by refinement, or in Python"))
    rows.append(("element", shown(scene["element"])))
    for kind, place in (("material", "region"), ("displacement", "boundary"), ("traction", "boundary")):
        nothing = 0.0 if kind == "traction" else None
        rows += [(_named(kind, entry.get(place) or ""), _data(entry, place, nothing=nothing)) for entry in scene[kind]]
    if scene.get("body_force"):
        rows.append(("body force", _data(scene["body_force"], nothing=0.0)))
    for entry in scene["contact"]:
        friction = entry.get("friction") or {"law": "none"}
        rest = {key: value for key, value in entry.items() if key != "friction"}
        rows.append((_named(f"{entry['kind']} contact", entry["boundary"]), _data(rest, "boundary", "kind")))
        rows.append((_named(f"friction: {friction['law']}", entry["boundary"]), _data(friction, "law")))
    method = {"algorithm": summary["algorithm"], **summary["parameters"], "linear algebra": summary["linear_algebra"]}
    whole = tag("pre", json.dumps(scene, indent=1))
    return joined(
        [
            table(["effect", "data"], rows),
            tag("p", f"Method: {shown(method)}."),
            tag("details", tag("summary", "The whole scene, all defaults included"), whole),
        ]
    )


def _named(name: str, remark: str) -> Markup:
    """A name with a remark below it."""
    return joined([name, tag("small", remark)] if remark else [name])


def _data(entry: Mapping[str, Any], *leave_out: str, nothing: float | None = None) -> str:
    """What an effect says; ``nothing`` is what a load that is not there says."""
    said = {key: value for key, value in entry.items() if key not in leave_out and value not in (None, nothing)}
    factors = said.pop("factors", None)
    return shown(said) + (f", times {len(factors)} factors, one a load step" if factors else "")


def _deformed(folder: _Folder) -> Markup:
    data = folder.picture("deformed.png")
    if data is None:
        return tag("p", "No picture: this was solved with --no-pictures.", class_="note")
    caption = "Displacement magnified as the title says; gray: elastic shear energy density; lines: the foundation."
    whole = _picture(data, "png", "deformed body on its foundation", caption)
    fields = {caption: folder.picture(f"{stem}.png") for stem, caption in FIELDS.items()}
    others = [_picture(data, "png", caption, caption) for caption, data in fields.items() if data is not None]
    return joined([whole, tag("div", *others, class_="pictures")] if others else [whole])


def _profiles(contact: dict[str, Any]) -> Markup:
    from signorini_fx.report import plots

    frictional = bool(np.any(contact["bound"] != 0) or np.any(contact["friction"] != "none"))
    sides = {"contact": "Contact pressure, normal displacement and foundation; below, what is in contact."}
    if frictional:
        sides["friction"] = "Shear, its bounds and tangential displacement; below, where friction sticks and slips."
    drawn = [
        _picture(_drawn(".svg", plots.boundary_profiles, contact, sides=[side]), "svg+xml", caption, caption)
        for side, caption in sides.items()
    ]
    signs = "Normal displacement above the foundation is penetration; shear has the sign of the slip."
    return joined([tag("div", *drawn, class_="pictures"), tag("p", signs, class_="note")])


def _zones(summary: dict[str, Any]) -> Markup:
    size = max((abs(c) for runs in summary["zones"].values() for run in runs for end in run for c in end), default=0.0)
    rows = []
    for name, runs in summary["zones"].items():
        for first, last in runs:
            rows.append((name, shown(_clean(first, size)), shown(_clean(last, size)), math.dist(first, last)))
    if not rows:
        return tag("p", "Nothing is in contact.")
    note = "From node to node: the true ends lie up to one element further out. Stick and slip where friction can act."
    return joined([table(["zone", "from", "to", "chord"], rows), tag("p", note, class_="note")])


def _steps(folder: _Folder, steps: dict[str, Any]) -> Markup:
    from signorini_fx.report import plots

    parts = []
    if "contact_force_x" in steps:
        caption = "Above: forces of the foundation on the body. Below: friction force against motion."
        pictures = [_picture(_drawn(".svg", plots.load_steps, steps), "svg+xml", caption, caption)]
        if (folder.path / "contact_steps.csv").is_file():
            moving = _drawn(".gif", plots.step_animation, folder.columns("contact_steps.csv"))
            caption = "Pressure, shear and states along the contact boundary, step by step."
            pictures.append(_picture(moving, "gif", caption, caption, "moving"))
        parts.append(tag("div", *pictures, class_="pictures"))
    return joined([*parts, _long_table("Every load step", steps, "steps.csv")])


def _prices(rows: list[dict[str, Any]]) -> Markup:
    from signorini_fx.report import plots

    names = ["h", "dofs", "linear_solves", "seconds", "memory", "energy", "pressure", "force", "zone", "peak"]
    names += ["regularisation", "iteration"]
    shorter = [[_short(row[name]) for name in names] + ["predicted" if row["predicted"] else ""] for row in rows]
    caption = "Estimated relative errors against the time of each mesh; open: the next mesh, predicted."
    note = (
        "One row a mesh. Energy: displacement in the energy norm; pressure; force; zone: ends of the contact zones; "
        "peak: largest pressure; of the energy error, what the regularisation and the iteration leave. Memory in MB."
    )
    classes = ["predicted" if row["predicted"] else "" for row in rows]
    return joined(
        [
            table([*(name.replace("_", " ") for name in names), ""], shorter, classes),
            tag("p", note, class_="note"),
            _picture(_drawn(".svg", plots.price_list, rows), "svg+xml", caption, caption),
        ]
    )


def _short(value: float | None) -> Any:
    """Estimates have no more digits than these."""
    return float(f"{value:.2g}") if isinstance(value, float) else value


def _history(folder: _Folder, history: dict[str, Any]) -> Markup:
    from signorini_fx.report import plots

    parts = []
    if history:
        caption = "Sizes of the active sets and nodes that change, and residual, against the linear solves."
        drawn = _drawn(".svg", plots.iteration_history, history)
        parts = [
            _picture(drawn, "svg+xml", caption, caption),
            _long_table("Every linear solve", history, "history.csv"),
        ]
    outer = folder.columns("outer.csv")
    if outer:
        parts.append(_long_table("Every regularised problem", outer, "outer.csv"))
    return joined(parts)


def next_steps(summary: dict[str, Any], contact: dict[str, Any]) -> list[str]:
    """What to do with this result, most urgent first.

    Args:
        summary: what summary.json says.
        contact: columns of contact.csv, empty without contact.
    """
    advice = []
    if summary["status"] != Status.CONVERGED.value:
        advice.append(
            "What to do first is said at the top. Before the next solve, signorini-fx check SCENE says what will hurt, "
            "and why."
        )
        if summary["status"] not in _SHORT_OF_ACCURACY:
            return advice
    prices = summary.get("price_list", [])
    if prices:
        *_, last, following = prices
        errors = {name: last[name] for name in ("energy", "pressure", "force", "zone", "peak") if last[name]}
        told = ", ".join(f"{name} {_percent(value)}" for name, value in errors.items())
        cost = f"{following['seconds']:.2g} s and {following['memory']:.0f} MB, {following['dofs']} unknowns"
        energy = f", energy error then {_percent(following['energy'])}" if following["energy"] else ""
        advice.append(f"Estimated errors of this mesh: {told}. The next one would take about {cost}{energy}.")
        if last["energy"] and last["regularisation"] > 0.2 * last["energy"]:
            advice.append(
                "The regularisation takes a notable part of the error: raise solver.gamma_n and solver.gamma_t, or "
                "take solver.algorithm = 'path-following' or 'exact'."
            )
    elif contact and "steps" not in summary:
        advice.append(
            "How accurate this is has not been estimated: solve with --levels 3 (a mesh from a generator), or ask "
            "for an accuracy, as with --accuracy 0.05."
        )
    if contact:
        # The arc length starts again with each connected piece, and so with each boundary.
        piece = np.cumsum(np.diff(contact["s"], prepend=-1.0) <= 0)
        nodes = zip(piece, contact["state"] != "open", strict=True)
        runs = [len(list(run)) for (_, touching), run in groupby(nodes) if touching]
        if runs and min(runs) < FEW_NODES:
            advice.append(
                f"A contact zone has only {min(runs)} node{'s' * (min(runs) > 1)}: refine there before its ends or "
                "its largest pressure are used."
            )
        if np.any(contact["bound"] > 0) and not np.any(contact["friction"] == "stick"):
            advice.append("Every node with friction slips: friction is at its limit.")
    if summary.get("fields"):
        advice.append(f"Look at the fields in ParaView: {', '.join(summary['fields'])}.")
    return advice


def _percent(value: float) -> str:
    return f"{100 * value:.2g} %" if value > 1e-5 else "below 0.001 %"


def _made_with(summary: dict[str, Any]) -> Markup:
    timings = table(["phase", "seconds"], [(name, _short(value)) for name, value in summary["timings"].items()])
    versions = table(["program", "version"], list(summary["versions"].items()))
    ranks = f"{summary['ranks']} rank{'s' * (summary['ranks'] > 1)}; compiled: {', '.join(summary['compiled'])}."
    return joined([tag("p", ranks), tag("div", timings, versions, class_="pictures")])


# --- the page --------------------------------------------------------------------------------------------------------


def page(folder: Path) -> str:
    """The report of a result folder.

    Raises:
        ResultError: it is no result folder, or not whole.
    """
    summary = read_summary(folder)
    try:
        return _page(summary, _Folder(folder), folder.resolve().name)
    except FileNotFoundError as error:
        name = Path(error.filename).name
        raise ResultError(f"{folder}: {name} is missing, so this is only a part of a result: solve again") from None
    except (ArithmeticError, AttributeError, LookupError, OSError, RecursionError, TypeError, ValueError) as error:
        raise ResultError(
            f"{folder}: its files are not as signorini-fx {__version__} writes them, or do not belong together "
            f"({type(error).__name__}: {error}): solve again"
        ) from error


def _page(summary: dict[str, Any], folder: _Folder, name: str) -> str:
    contact = folder.columns("contact.csv", summary["contact_nodes"]) if "zones" in summary else {}
    sections = {
        "Outcome": _outcome(summary),
        "Certificate": _certificate(summary),
        "Scene and effects": _scene(summary),
    }
    sections["What to do next"] = tag("ul", *(tag("li", line) for line in next_steps(summary, contact)))
    sections["Deformed body"] = _deformed(folder)
    if contact:
        sections["Contact boundary"] = _profiles(contact)
        sections["Zones"] = _zones(summary)
    if "steps" in summary:
        sections["Load steps"] = _steps(folder, folder.columns("steps.csv", len(summary["steps"])))
    if "price_list" in summary:
        sections["Price list"] = _prices(summary["price_list"])
    if contact:
        sections["Iteration"] = _history(folder, folder.columns("history.csv", summary["linear_solves"]))
    sections["Made with"] = _made_with(summary)
    title = summary["title"] or name
    style = Markup(resources.files("signorini_fx.report").joinpath("report.css").read_text(encoding="utf-8"))
    anchors = {heading: heading.lower().replace(" ", "-") for heading in sections}
    parts = [tag("section", tag("h2", heading), text, id=anchors[heading]) for heading, text in sections.items()]
    whole = tag(
        "html",
        tag(
            "head",
            tag("meta", charset="utf-8"),
            tag("meta", name_="viewport", content="width=device-width, initial-scale=1"),
            tag("title", f"{title}: {summary['status']}"),
            tag("style", style),
        ),
        tag(
            "body",
            tag("header", tag("h1", title), tag("p", name, class_="note")),
            tag("nav", *(tag("a", heading, href=f"#{anchor}") for heading, anchor in anchors.items())),
            tag("main", *parts),
            tag("footer", tag("p", f"signorini_fx {__version__}: signorini-fx report {name}")),
        ),
        lang="en",
    )
    return f"<!DOCTYPE html>\n{whole}\n"


def write_report(folder: str | Path, file: str | Path | None = None) -> Path:
    """Write the report of a result folder.

    Args:
        folder: what ``solve`` wrote.
        file: where to; None: ``report.html`` in the folder.

    Returns:
        The file.

    Raises:
        ResultError: the folder is no result, or half written.
        OutputError: the page cannot be written.
    """
    folder = Path(folder)
    file = folder / PAGE if file is None else Path(file)
    text = page(folder)
    part = file.parent / f".{file.name}.part"
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        part.write_text(text, encoding="utf-8", errors="xmlcharrefreplace")
        part.replace(file)
    except (OSError, ValueError) as error:  # ValueError: a null byte in the name
        with contextlib.suppress(OSError, ValueError):
            part.unlink(missing_ok=True)
        raise OutputError(f"{file}: cannot be written: {getattr(error, 'strerror', None) or error}") from None
    return file
