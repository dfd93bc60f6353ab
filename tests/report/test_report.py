"""The report of a result folder: one page, whole, with the numbers of the files, and nothing from
outside.
"""

import base64
import csv
import io
import math
import re
import shutil
import subprocess
import sys
import tempfile
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from commands import summary_in
from mpi4py import MPI
from on_meshes import at_coordinate
from PIL import Image
from scenes import alone, example1, on_mesh, rectangle

from signorini_fx.addons.report import markup, sections
from signorini_fx.addons.report import page as report
from signorini_fx.addons.report.markup import part
from signorini_fx.errors import ResultError
from signorini_fx.machine import parallel
from signorini_fx.mechanics.effects.contact import Contact
from signorini_fx.mechanics.mesh.tagged import tag_boundaries
from signorini_fx.quantities.shown import figure
from signorini_fx.quantities.summary import CertificateFigures, PrintedNumber
from signorini_fx.records import JUDGED, REPORTED
from signorini_fx.results.certificate.certificate import Certificate
from signorini_fx.results.files import write_results
from signorini_fx.scenes import cli
from signorini_fx.scenes.solver import solve
from signorini_fx.tuned import CERTIFICATE_TOLERANCE

TITLE = r"""Tom & <b>Jerry</b> "1", 'two' $\frac$"""
_VOID = {"br", "img", "meta", "wbr"}


def stepped(factors=(0.5, 1.0, 0.25), **settings):
    data = example1(coefficient=0.3, nx=12, ny=4, **settings)
    loads = [load.model_copy(update={"factors": factors}) for load in data.traction]
    return data.model_copy(update={"traction": tuple(loads), "title": TITLE})


def not_held():
    data = example1(nx=12, ny=4)
    return data.model_copy(update={"displacement": ()})


def linear():
    data = example1(nx=12, ny=4)
    held = [entry.model_copy(update={"y": 0.0}) for entry in data.displacement]
    return data.model_copy(update={"displacement": tuple(held), "contact": ()})


def two_boundaries():
    """Names that no page must take for its own; one boundary has friction, the other has not."""
    tagged = rectangle(nx=24, ny=8)
    sides = {
        "<a&b>": lambda x: np.isclose(x[1], 0.0) & (x[0] < 1.5 + 1e-9),
        "$c$": lambda x: np.isclose(x[1], 0.0) & (x[0] > 1.5 - 1e-9),
        "left": at_coordinate(0, 0.0),
        "right": at_coordinate(0, 3.0),
        "top": at_coordinate(1, 1.0),
    }
    data = example1(bound=1.5, nx=12, ny=4)
    (first,) = data.contact
    halves = (
        first.model_copy(update={"boundary": "<a&b>"}),
        Contact(boundary="$c$", gap=first.gap),
    )
    return on_mesh(data.model_copy(update={"contact": halves}), tag_boundaries(tagged.mesh, sides))


SCENES = {
    "steps": stepped,
    "levels": lambda: example1(coefficient=0.3, nx=24, ny=8, levels=3),
    "linear": linear,
    "not held": not_held,
    "two boundaries": two_boundaries,
}


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    """A result folder of each scene, with its report."""
    found = {}
    for name, scene in SCENES.items():
        found[name] = tmp_path_factory.mktemp("results") / name
        drawn = name in ("steps", "linear", "not held")
        write_results(alone(scene(), check=False), found[name], fields=False, pictures=drawn)
        report.write_report(found[name])
    return found


@pytest.fixture(params=SCENES)
def folder(request, folders):
    return folders[request.param]


def summary_of(folder):
    return summary_in(folder)


def rows_of(file):
    return list(csv.DictReader(file.read_text(encoding="utf-8").splitlines()))


class Page(HTMLParser):
    """A page taken apart; elements that are not closed, or in the wrong order, are an error."""

    def __init__(self, folder):
        super().__init__(convert_charrefs=True)
        self.source = (folder / report.PAGE).read_text(encoding="utf-8")
        self.open, self.tags, self.attributes, self.ids, self.texts, self.cells = (
            [],
            [],
            [],
            set(),
            [],
            [],
        )
        self.feed(self.source)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        names = [name for name, _ in attrs]
        assert len(names) == len(set(names)), f"{tag}: {names}"
        self.tags.append(tag)
        self.attributes += [(tag, name, value) for name, value in attrs]
        self.ids.update(value for name, value in attrs if name == "id")
        if tag not in _VOID:
            self.open.append(tag)
        if tag in ("td", "dd", "h2"):
            self.cells.append((tag, ""))

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.texts.append(data)
        if any(tag in ("td", "dd", "h2") for tag in self.open) and "small" not in self.open:
            kind, text = self.cells[-1]
            self.cells[-1] = kind, text + data

    @property
    def text(self):
        return " ".join(self.texts)

    @property
    def classes(self):
        return {
            name for _, kind, value in self.attributes if kind == "class" for name in value.split()
        }

    def of(self, kind):
        return [text for tag, text in self.cells if tag == kind]


def pictures(page):
    """Kind and content of every picture of a page."""
    found = []
    for _, _, value in (a for a in page.attributes if a[:2] == ("img", "src")):
        kind, _, data = value.partition(";base64,")
        found.append((kind.removeprefix("data:image/"), base64.b64decode(data, validate=True)))
    return found


@pytest.mark.slow
def test_page_is_whole(folder):
    """Well-formed, one of each frame, readable on a phone, results before what stands behind them;
    links lead on.
    """
    page = Page(folder)
    assert page.source.startswith("<!DOCTYPE html>")
    for name in ("html", "head", "body", "title", "h1", "main"):
        assert page.tags.count(name) == 1
    assert ("meta", "content", "width=device-width, initial-scale=1") in page.attributes
    assert "@media print" in page.source
    headings = page.of("h2")
    assert headings[0] == "Outcome"
    assert headings[-1] == "Made with"
    assert ("Figures" in headings) == summary_of(folder)["converged"]
    assert headings[-1] == "Made with"
    behind = [
        headings.index(name)
        for name in ("Convergence table", "Certificate", "Iteration")
        if name in headings
    ]
    assert all(
        headings.index(name) < min(behind)
        for name in headings
        if name.startswith(("Contact", "Load"))
    )
    targets = {
        value.removeprefix("#")
        for tag, name, value in page.attributes
        if (tag, name) == ("a", "href")
    }
    assert targets == page.ids
    assert len(targets) == len(page.of("h2"))


def test_page_needs_nothing_else(folder):
    """No address, no file, no script: pictures are in the page, each with words for those who do
    not see it.
    """
    page = Page(folder)
    assert not set(page.tags) & {"link", "iframe", "object", "embed", "base", "form", "script"}
    rest = re.sub(r'"data:[^"]*"', "", page.source)
    assert re.findall(r"https?:|url\(|@import|[^:]//\w|sourceMappingURL", rest) == []
    for tag, name, value in page.attributes:
        assert not name.startswith("on")
        if name in ("src", "href", "srcset"):
            assert value.startswith(("data:image/", "#")), (tag, name, value[:40])
    alternatives = [value for tag, name, value in page.attributes if (tag, name) == ("img", "alt")]
    found = pictures(page)
    assert len(alternatives) == len(found)
    assert all(alternatives)
    for kind, data in found:
        with Image.open(io.BytesIO(data)) as image:
            assert image.format == kind.upper()


def test_numbers(folder):
    """Those of the summary, the certificate and the tables."""
    page, summary = Page(folder), summary_of(folder)
    assert summary["status"] in page.text
    cells = page.of("td")
    assert f"{summary['dofs']} unknowns" in page.text
    if not summary["converged"] and summary["linear_solves"] == 0:  # there are no others
        assert "The law is" not in page.text
        return
    assert f"The law is {markup.in_text(summary['certificate']['law'])}." in page.text
    for name, value in summary["certificate"].items():
        if name not in ("holds", "law"):
            assert float(cells[cells.index(name.replace("_", " ")) + 1]) == pytest.approx(
                value, rel=0.05, abs=1e-300
            )
    if "convergence_table" not in summary and summary["converged"]:
        if "strain_energy" in summary:
            assert f"{summary['strain_energy']:.6g}" in cells
        if "contact_force" in summary:
            first = " ".join(page.of("dd"))
            for name, words in (("force", ""), ("largest pressure", "largest pressure ")):
                assert f"{words}{PrintedNumber(**summary['numbers'][name])}" in first
    for row in summary.get("convergence_table", []):
        assert str(row["dofs"]) in cells
        assert f"{row['energy']:.2g}" in cells
    for step in summary.get("steps", []):
        assert f"{step['strain_energy']:.6g}" in cells
    for name, runs in summary.get("zones", {}).items():
        assert (f"{name} zone" in cells) == bool(runs)


def test_sections(folders):
    """What a scene does not have is not on its page."""
    headings = {name: set(Page(folder).of("h2")) for name, folder in folders.items()}
    assert {"Contact", "Iteration", "Load steps"} <= headings["steps"]
    assert "Convergence table" in headings["levels"]
    assert "Load steps" not in headings["levels"]
    assert not {"Contact", "Iteration", "Load steps", "Convergence table"} & headings["linear"]
    assert not {"Certificate", "Contact"} & headings["not held"]
    drawn = {name: len(pictures(Page(folder))) for name, folder in folders.items()}
    assert drawn["linear"] == drawn["not held"] == 1  # the latter of what the scene prescribes
    assert drawn["steps"] == len(["deformed", "profiles", "load_steps"])
    assert drawn["levels"] == 0  # solved without


def test_escapes(folders):
    """Names with markup, quotes and dollars are shown as they are, and are no markup; pictures are
    drawn too.
    """
    page = Page(folders["steps"])
    assert page.texts.count(TITLE) == 1
    assert any(text == f"{TITLE}: converged" for text in page.texts)
    assert "b" not in page.tags
    other = Page(folders["two boundaries"])
    assert "<a&b>" in other.text
    assert "$c$" in other.text
    assert "<a&b>" not in other.source
    assert part("note", "<&>\"'") == '<p class="note">&lt;&amp;&gt;&#34;&#39;</p>'


def test_verdict(folders):
    """A result that is none is not taken for one."""
    page = Page(folders["not held"])
    assert "Nothing was solved, so there are no figures." in page.text
    assert (folders["not held"] / "setup.png").exists()
    assert not (folders["not held"] / "deformed.png").exists()
    summary = summary_of(folders["levels"])
    refused = summary["certificate"] | {"holds": False, "equilibrium": 1.0}
    files = folders["steps"]
    failed = summary | {"status": "active sets cycle", "converged": False, "certificate": refused}
    assert (
        "does NOT hold. All figures are of the last iterate: do not use them."
        in sections.outcome(failed, files)
    )
    assert ">violated<" in sections.certificate(failed)
    place = {"value": 2.0, "place": [1.0, 0.0]}
    known = {"stress": {"von_mises": place, "recovered": {"von_mises": place}}}
    assert "; circle: the largest one" in sections.outcome(summary | known, files)
    iterate = sections.outcome(failed | known, files)
    assert "Of the last iterate, which is no solution." in iterate
    assert "circle" not in iterate
    warning = {"level": "warning", "path": "material", "message": "strains of 3.5e+02"}
    assert f"strains of {markup.in_text('3.5e+02')}." in sections.outcome(
        failed | {"findings": [warning]}, files
    )
    assert any(value == "status bad" for _, name, value in page.attributes if name == "class")
    good = Page(folders["levels"])
    assert "violated" not in good.of("td")
    assert any(value == "status good" for _, name, value in good.attributes if name == "class")


def test_the_short_answer_comes_first(folders):
    """Beside the picture, with the load step that it is of."""
    page = Page(folders["steps"])
    assert "All figures are of load step 3" in page.text
    assert (
        page.source.index("<dt>force</dt>")
        < page.source.index("deformed body on its foundation")
        < page.source.index("<h2>Figures")
    )


def test_figures_of_the_certificate():
    """Every figure has a meaning; those that are judged refuse the certificate, and no others
    do.
    """
    zero = Certificate()
    assert zero.holds
    for name in (*JUDGED, *REPORTED):
        assert CertificateFigures.model_fields[name].description
        assert replace(zero, **{name: 1e300}).holds == (name in REPORTED)
    for name in JUDGED:
        assert replace(zero, **{name: CERTIFICATE_TOLERANCE}).holds
        assert not replace(zero, **{name: 1.01 * CERTIFICATE_TOLERANCE}).holds


# --- folders that are no result -------------------------------------------------------------------


def broken(folder, tmp_path, *names, **texts):
    """A copy without some files, or with others of its own."""
    copy = tmp_path / "copy"
    shutil.copytree(folder, copy)
    (copy / report.PAGE).unlink()
    for name in names:
        (copy / name).unlink()
    for name, text in texts.items():
        (copy / name.replace("_", ".")).write_text(text, encoding="utf-8")
    return copy


@pytest.mark.one_quick(
    ("names", "texts", "message"),
    [
        (["summary.json"], {}, "half written"),
        (["steps.csv"], {}, r"steps\.csv is missing"),
        ([], {"summary_json": "{"}, "cannot be read"),
        ([], {"summary_json": "[]"}, "signorini-fx solve has not written it"),
        ([], {"summary_json": '{"status": "converged"}'}, "signorini-fx solve has not written it"),
        (
            [],
            {"summary_json": '{"status": 1, "certificate": 2, "scene": 3, "linear_solves": 4}'},
            "not as signorini-fx .* writes them",
        ),
        ([], {"steps_csv": "x,y\n1\n"}, "not as signorini-fx .* writes them"),
        ([], {"steps_csv": "step\n0\n1\n"}, "steps.csv has 2 rows, 3 are expected"),
    ],
)
def test_broken_folders(folders, tmp_path, capsys, names, texts, message):
    """One sentence that names the place; no page, no traceback."""
    copy = broken(folders["steps"], tmp_path, *names, **texts)
    with pytest.raises(ResultError, match=message):
        report.write_report(copy)
    assert not (copy / report.PAGE).exists()
    assert cli.main(["report", str(copy)]) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert re.fullmatch(rf"signorini-fx: error: {re.escape(str(copy))}[^\n]*\n", printed.err)


def test_no_folder(tmp_path):
    """Nothing there, a file, an empty folder, a solve that is under way."""
    with pytest.raises(ResultError, match="is not there"):
        report.write_report(tmp_path / "none")
    (tmp_path / "file").write_text("")
    with pytest.raises(ResultError, match="is a file"):
        report.write_report(tmp_path / "file")
    (tmp_path / "empty").mkdir()
    with pytest.raises(ResultError, match="is no result folder"):
        report.write_report(tmp_path / "empty")
    (tmp_path / "empty" / ".signorini_fx.part").mkdir()
    with pytest.raises(ResultError, match="half written"):
        report.write_report(tmp_path / "empty")


@pytest.mark.slow
def test_without_pictures(tmp_path):
    """They are missed in words.  A new solve takes an old page away."""
    folder = tmp_path / "plain"
    solution = alone(example1(nx=12, ny=4))
    write_results(solution, folder, fields=False)
    report.write_report(folder)
    assert (folder / "deformed.png").exists()
    write_results(solution, folder, fields=False, pictures=False)
    assert not list(folder.glob("*.png"))
    assert not (folder / report.PAGE).exists()
    report.write_report(folder)
    page = Page(folder)
    assert "--no-pictures" in page.text
    assert pictures(page) == []


@pytest.mark.slow
def test_no_solver_is_imported(folders, tmp_path):
    """The command works where dolfinx is not: only the files are read."""
    code = (
        "import sys\n"
        "from signorini_fx.scenes.cli import main\n"
        f"code = main(['report', {str(folders['steps'])!r}, '--out', "
        f"{str(tmp_path / 'page.html')!r}])\n"
        "print(code, [name for name in ('dolfinx', 'petsc4py', 'mpi4py', 'ufl', 'gmsh') if name "
        "in sys.modules])\n"
    )
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", code], capture_output=True, text=True, check=False
    )
    assert (done.stdout.splitlines()[-1:], done.stderr) == (["0 []"], "")


# --- the contact boundary of every load step ------------------------------------------------------


@pytest.mark.mpi(slow=True)
def test_contact_of_every_step():
    """contact_steps.csv has each step's contact boundary, whole, on any number of ranks; the last
    is contact.csv.
    """
    comm = MPI.COMM_WORLD
    folder = Path(parallel.on_root(comm, tempfile.mkdtemp))
    try:
        summary = write_results(solve(stepped(), comm), folder, fields=False, pictures=False)
        steps, last = rows_of(folder / "contact_steps.csv"), rows_of(folder / "contact.csv")
        assert [int(row["step"]) for row in steps] == [k for k in (1, 2, 3) for _ in range(13)]
        final = [row for row in steps if row["step"] == "3"]
        assert [{k: v for k, v in row.items() if k != "step"} for row in final] == [
            {k: row[k] for k in final[0] if k != "step"} for row in last
        ]
        for step, row in enumerate(summary["steps"], start=1):
            pressures = [float(node["pressure"]) for node in steps if node["step"] == str(step)]
            assert max(pressures) == pytest.approx(row["max_pressure"], rel=1e-12)
    finally:
        comm.barrier()
        parallel.on_root(comm, lambda: shutil.rmtree(folder))


# --- digits ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (5.48123, "5.481"),
        (548123.0, "548100"),
        (1.23456e-7, "1.235e-07"),
        (-20.0, "-20"),
        ([0.0, 0.0], "(0, 0)"),
        ([-2296.2963, 0.0, 37037.01], "(-2296, 0, 37040)"),
        ([3.0, 0.52163], "(3, 0.5216)"),
        ([1e-9, 20.0], "(0, 20)"),  # not known beside the other one
        (math.inf, "inf"),
        (17, "17"),  # a count
        (None, ""),
    ],
)
def test_digits(value, text):
    """Of a figure without an error."""
    assert figure(value) == text


# --- provenance -----------------------------------------------------------------------------------
