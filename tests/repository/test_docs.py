"""README and docs: every block runs, every link resolves, every key, default, outcome and result is
named.

A fenced block is run unless the line before it says ``<!-- not run: REASON -->``: python is
executed; toml is a scene that is checked, or a part of one; sh holds commands of signorini-fx.  A
text that follows one of these without a word between is what it prints, or some of these lines,
with ``...`` for what differs from run to run.  Blocks of a document share a folder.
"""

import csv
import importlib
import inspect
import json
import os
import pkgutil
import re
import runpy
import shlex
import subprocess
import sys
import tomllib
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Literal, get_args, get_origin

import pytest
import words
from deck_lines import stacked
from pydantic import BaseModel
from quantities import markdown
from scenes import alone, example1
from setuptools import find_packages

import signorini_fx
from signorini_fx.mechanics.effects import contact, displacement, loads
from signorini_fx.mechanics.effects.contact import Overclosure
from signorini_fx.mechanics.effects.heat import Heat, InitialTemperature
from signorini_fx.mechanics.effects.inertia import Inertia, InitialVelocity
from signorini_fx.mechanics.effects.wear import Archard
from signorini_fx.mechanics.laws.coulomb import Coulomb, NoFriction, Tresca
from signorini_fx.mechanics.laws.stribeck import SpeedTable, Stribeck
from signorini_fx.mechanics.materials.hyperelastic import (
    MooneyRivlin,
    NeoHooke,
    Ogden,
    SaintVenantKirchhoff,
)
from signorini_fx.mechanics.materials.isotropic import LinearElastic
from signorini_fx.mechanics.materials.orthotropic import Orthotropic, OrthotropicElastic
from signorini_fx.mechanics.materials.path_dependent import J2, Maxwell
from signorini_fx.mechanics.statement import settings
from signorini_fx.mechanics.statement.load_path import LoadSteps
from signorini_fx.mechanics.statement.mesh_sources import MeshFile, known_generators
from signorini_fx.mechanics.statement.rigid_body import RigidMotion
from signorini_fx.records import JUDGED, REPORTED, Status
from signorini_fx.results.files import write_results
from signorini_fx.scenes import cli, scene
from signorini_fx.scenes.checks import check_scene
from signorini_fx.scenes.reading import parse_scene, read_scene
from signorini_fx.scenes.template import described, starting_scene

ROOT = Path(__file__).parents[2]
README, DOCS = ROOT / "README.md", ROOT / "docs"

THEORY = DOCS / "theory.md"
OWN_BODY = DOCS / "own-body.md"
EXAMPLES = DOCS / "i-want-to.md"
# Pages whose blocks are run; the others are theory, and comparisons with other programs.
OTHERS = ("theory", "verification", "architecture", "coming-from", "gallery")
MANUAL = [page for page in sorted(DOCS.glob("*.md")) if page.stem not in OTHERS]
PAGES = sorted(
    [*ROOT.glob("*.md"), *(ROOT / "docs").glob("*.md"), *(ROOT / ".github").rglob("*.md")]
)
MODULES = {module.name for module in pkgutil.iter_modules(signorini_fx.__path__)}


# --- blocks ---------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Block:
    """A fenced block: where it begins, its language and text, why it is not run, if so, and what it
    prints.
    """

    page: Path
    line: int
    language: str
    text: str
    reason: str | None
    printed: str = ""

    def __str__(self):
        return f"{self.page.name}:{self.line}"


def blocks_of(page):
    """The fenced blocks of a page, in order."""
    text = page.read_text(encoding="utf-8")
    found = []
    for match in re.finditer(
        r"(?:<!-- not run: (.+) -->\n)?^```(.*)\n((?:(?!```).*\n)*)^```$", text, re.MULTILINE
    ):
        line = text[: match.start(2)].count("\n") + 1
        follows = re.match(
            r"\n\n```text\n((?:(?!```).*\n)*)```$", text[match.end() :], re.MULTILINE
        )
        found.append(Block(page, line, match[2], match[3], match[1], follows[1] if follows else ""))
    assert text.count("```") == 2 * len(found), f"{page}: a block is not understood"
    return found


BLOCKS = [block for page in (README, *MANUAL) for block in blocks_of(page)]


def each_block(language):
    """All blocks of a language that are to be run; each has the name of its page and its number
    there, since the list of slow tests has these names, and lines change with every edit.
    """
    wanted = [block for block in BLOCKS if block.language == language and block.reason is None]
    names = [
        f"{one.page.name} {[other for other in BLOCKS if other.page == one.page].index(one) + 1}"
        for one in wanted
    ]
    return pytest.mark.parametrize("block", wanted, ids=names)


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    """One folder a page, with the scene that its commands and scripts are about, and the meshes
    that it shows.
    """
    found = {page: tmp_path_factory.mktemp(page.stem) for page in (README, *MANUAL)}
    bracket = first_block(OWN_BODY, "geo").text
    for page, folder in found.items():
        (folder / "demos").symlink_to(ROOT / "demos")
        scene_file = first_block(README, "toml").text if page == README else starting_scene()
        (folder / "scene.toml").write_text(scene_file, encoding="utf-8")
        drawn = first_block(page, "geo")
        (folder / "body.geo").write_text(drawn.text if drawn else bracket, encoding="utf-8")
    for block in blocks_of(EXAMPLES):
        if block.language == "toml":
            name = re.match(r"# (\w+\.toml): ", block.text)[1]
            (found[EXAMPLES] / name).write_text(block.text, encoding="utf-8")
    (found[EXAMPLES] / "part.inp").write_text("\n".join(stacked([])) + "\n", encoding="utf-8")
    for block in blocks_of(OWN_BODY):
        if block.language == "toml":
            name = re.search(r'file = "(\w+)', block.text)[1].replace("body", "bracket")
            (found[OWN_BODY] / f"{name}.toml").write_text(block.text, encoding="utf-8")
    write_meshes(found[OWN_BODY])
    return found


def first_block(page, language):
    """The first block of a page in this language, None if there is none."""
    return next((block for block in blocks_of(page) if block.language == language), None)


def write_meshes(folder):
    """What a page shows how to make, for a test that runs one of its blocks alone."""
    script = first_block(OWN_BODY, "python").text
    exec(compile(script.replace("foot.step", f"{folder}/foot.step"), "foot", "exec"), {})


@pytest.fixture
def folder(block, folders, monkeypatch):
    """The folder of the block's page, to work in."""
    monkeypatch.chdir(folders[block.page])
    return folders[block.page]


def test_blocks():
    """They are found, in languages that are known; few are not run, each for a reason."""
    languages = {block.language for block in BLOCKS}
    assert languages == {"geo", "python", "sh", "text", "toml", "{eval-rst}", "{toctree}"}
    for page, languages in ((README, ("toml", "python", "sh")), (OWN_BODY, ("geo", "toml", "sh"))):
        for language in languages:
            assert any(
                b.page == page and b.language == language and b.reason is None for b in BLOCKS
            )
    not_run = {block.reason for block in BLOCKS if block.reason is not None}
    assert not_run <= {
        "installs packages",
        "needs Docker",
        "needs Docker, Apptainer and a cluster",
        "needs two machines",
        "opens a window",
        "these are the commands that run the tests",
    }


def test_length_and_readability():
    """The README is read in five minutes; few sentences have more than 25 words (docs/words.py
    --long).
    """
    assert words.words(README) <= 900
    assert words.long_sentences(README) == []
    assert sum(map(words.words, words.pages())) <= 27_000
    for page in words.pages():
        assert len(words.long_sentences(page)) <= 0.05 * len(words.sentences(page)), page


def test_length_of_the_examples():
    """Each has twelve lines or fewer beside its name and imports, a command or a program, and a
    picture of its own.
    """
    text = EXAMPLES.read_text(encoding="utf-8")
    asked = re.split(r"^## ", text, flags=re.MULTILINE)[1:]
    assert len(asked) == 17
    for block in blocks_of(EXAMPLES):
        lines = [
            line
            for line in block.text.splitlines()
            if line and not re.match("#|import |from ", line)
        ]
        assert 0 < len(lines) <= 12, block
        assert all(len(line) <= 120 for line in lines), block
    pictures = [re.findall(r"!\[.+\]\((images/[\w/-]+\.png)\)", one) for one in asked]
    assert all(len(one) == 1 for one in pictures)
    assert len({one for (one,) in pictures}) == 17
    assert all(re.search("^```(sh|python)$", one, re.MULTILINE) for one in asked)


@pytest.mark.one_quick
@each_block("toml")
def test_toml(block, folder):
    """A whole scene passes ``check`` without a warning; tables alone fit the scene of the
    README.
    """
    data = tomllib.loads(block.text)
    if {"mesh", "body"} & data.keys():
        file = folder / "shown.toml"
        file.write_text(block.text, encoding="utf-8")
        assert check_scene(read_scene(file)).warnings == ()
    else:
        whole = next(b for b in BLOCKS if b.page == README and b.language == "toml")
        parse_scene({**tomllib.loads(whole.text), **data}, str(block))


@pytest.mark.one_quick
@each_block("python")
def test_python(block, folder, capsys):
    """A script of its own."""
    lines = "\n" * block.line + block.text
    exec(compile(lines, str(block.page), "exec"), {"__name__": "__main__"})
    is_printed(block, capsys.readouterr().out)


# Numbers are as on the page but for this, relative: linear algebra differs from machine to machine.
CLOSE = 0.05


def is_printed(block, printed):
    """Each line of the block's output is among these, in this order."""
    lines = iter(printed.splitlines())
    for wanted in block.printed.splitlines():
        assert any(alike(wanted, line) for line in lines), f"{block}: {wanted}\n{printed}"


def alike(wanted, printed):
    """Whether two lines have the same words; ``...`` stands for any one, and numbers are close."""
    words = printed.split()
    return len(wanted.split()) <= len(words) and all(map(alike_word, wanted.split(), words))


def alike_word(wanted, word):
    try:
        return wanted == "..." or float(word.strip("(),:")) == pytest.approx(
            float(wanted.strip("(),:")), rel=CLOSE
        )
    except ValueError:
        return wanted == word


@pytest.mark.one_quick
@each_block("sh")
def test_commands(block, folder, capsys):
    """They end well, on one rank, without their pictures and, but for the README, fields; PETSc
    knows all their options.
    """
    printed = ""
    for line in block.text.replace("\\\n", " ").splitlines():
        words = shlex.split(line, comments=True)
        words = words[1:] if words[:1] == ["./env"] else words
        words = words[3:] if words[:2] == ["mpirun", "-n"] else words
        name, command, *arguments = words
        assert name == "signorini-fx", f"{block}: not a command of this package: mark the block"
        if command == "new":
            Path(arguments[0]).unlink(missing_ok=True)
        if command == "solve":
            fields = ["--no-fields"] * (block.page != README)
            arguments = ["--no-pictures", *fields, *arguments]
        if ">" in arguments:
            assert Path(arguments.pop()).suffix == ".json"
            assert arguments.pop() == ">"
        if "--" in arguments:
            separately([sys.executable, "-m", "signorini_fx", command, *arguments])
        else:
            assert cli.main([command, *arguments]) == 0, line
            output = capsys.readouterr()
            assert output.err == ""
            printed += output.out
    is_printed(block, printed)


def separately(command):
    """Run a command in a process of its own, which knows nothing of the MPI of this one."""
    clean = {k: v for k, v in os.environ.items() if not k.startswith(("OMPI_COMM", "PMIX_"))}
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=clean)
    assert done.returncode == 0, done.stderr
    assert "not used" not in done.stdout + done.stderr


SCRIPTS = ["benchmarks/costs/run.py"]
SCRIPTS += [str(path.relative_to(ROOT)) for path in sorted((ROOT / "demos").rglob("*.py"))]
PROGRAMS = {str(block): block.text for block in BLOCKS if block.language == "python"}
PROGRAMS |= {name: (ROOT / name).read_text(encoding="utf-8") for name in SCRIPTS}


@pytest.mark.parametrize("name", PROGRAMS)
def test_mpi_is_imported_first(name):
    """Wheels of FEniCSx load the library of MPI with mpi4py: what imports dolfinx or PETSc before
    it does not start.
    """
    imports = re.findall(
        r"^\s*(?:from|import) (mpi4py|dolfinx|petsc4py|signorini_fx)\b",
        PROGRAMS[name],
        re.MULTILINE,
    )
    assert not imports or imports[0] in ("mpi4py", "signorini_fx")


def test_synopsis():
    """The page of the command line lists the commands with all their options, and explains them."""
    page = DOCS / "command-line.md"
    (synopsis,) = (block.text for block in blocks_of(page) if block.language == "text")
    (commands,) = (
        action.choices for action in cli.parser()._actions if isinstance(action.choices, dict)
    )
    lines = synopsis.replace("\n  ", "").splitlines()
    shown = {line.split()[1]: set(re.findall(r"--\w[\w-]*", line)) for line in lines}
    known = {
        name: {o for action in parser._actions for o in action.option_strings if o.startswith("--")}
        - {"--help"}
        for name, parser in commands.items()
    }
    assert shown == known
    explained = page.read_text(encoding="utf-8").replace(synopsis, "")
    for name, options in known.items():
        assert f"`{name}" in explained
        assert options <= set(re.findall(r"--\w[\w-]*", explained))


# --- links ----------------------------------------------------------------------------------------


def anchors(page):
    """The anchors that GitHub makes of the headings."""
    headings = re.findall(r"^#+ (.*)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links(page):
    """Files and headings that are linked are there."""
    for target in re.findall(r"\]\(([^)\s]+)\)", page.read_text(encoding="utf-8")):
        if re.match(r"\w+:", target):
            continue
        name, _, anchor = target.partition("#")
        file = (page.parent / name).resolve() if name else page
        assert file.exists(), target
        assert file.is_relative_to(ROOT), target
        if anchor:
            assert anchor in anchors(file), target


def test_contributing():
    """What it names is there: files, and targets of make."""
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    folders = (ROOT, ROOT / "signorini_fx", ROOT / "signorini_fx" / "algebra" / "algorithms")
    for name in set(re.findall(r"`([\w./-]+\.(?:py|md|toml))`", text)):
        assert any((folder / name).is_file() for folder in folders), name
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    targets = set(re.findall(r"`make ([a-z-]+)`|^make ([a-z-]+) ", text, re.MULTILINE))
    assert {
        name for pair in targets for name in pair if f"\n{name}:" not in makefile and name
    } == set()


def test_hooks_are_the_commands_of_ci():
    """pre-commit runs what .ci/run runs."""
    hooks = re.findall(
        r"entry: (.+)", (ROOT / ".pre-commit-config.yaml").read_text(encoding="utf-8")
    )
    commands = re.findall(
        r"^make .+", (ROOT / ".ci" / "run").read_text(encoding="utf-8"), re.MULTILINE
    )
    assert hooks == commands
    assert hooks


def test_workflows():
    """Actions are named by their commits, and a release by the version of the package."""
    texts = {path.stem: path.read_text() for path in (ROOT / ".github/workflows").glob("*.yml")}
    uses = re.findall(r"uses: (\S+)", "".join(texts.values()))
    assert all(re.fullmatch(r"[\w/-]+@[0-9a-f]{40}", name) for name in uses)
    assert "__version__" in texts["release"]


def test_one_version():
    """The package's, and nowhere another one."""
    version = signorini_fx.__version__
    assert re.fullmatch(r"\d+\.\d+\.\d+", version)
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert f"\nversion: {version}\n" in citation
    headings = re.findall(
        r"^## \[(.+?)\]", (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), re.MULTILINE
    )
    assert version in headings[:2]
    assert headings[0] in (version, "Unreleased")
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    assert "version" not in project["project"]
    assert project["tool"]["setuptools"]["dynamic"]["version"]["attr"] == "signorini_fx.__version__"


def test_everything_is_shipped():
    """Files that are no Python, py.typed among them, and all packages."""
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"][
        "setuptools"
    ]
    package = ROOT / "signorini_fx"
    others = [
        file for file in package.rglob("*") if file.is_file() and "__pycache__" not in file.parts
    ]
    data = {str(file.relative_to(package)) for file in others if file.suffix != ".py"}
    assert "py.typed" in data
    assert set(settings["package-data"]["signorini_fx"]) == data
    folders = {
        ".".join(file.parent.relative_to(ROOT).parts) for file in package.rglob("__init__.py")
    }
    found = find_packages(str(ROOT), include=settings["packages"]["find"]["include"])
    assert set(found) == folders | {"signorini_fx.meshes"}


def test_description():
    """An index of packages shows a text without links and images of files that it does not have."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    text = project["readme"]["text"]
    assert text.startswith(f"# {project['name']}\n")
    assert "![" not in text
    assert all(target.startswith("https:") for target in re.findall(r"\]\((.*?)\)", text))


# --- scenes ---------------------------------------------------------------------------------------


def cells_of(row):
    """The cells of a line of a table."""
    return [cell.strip().replace("\\|", "|") for cell in re.split(r"(?<!\\)\|", row.strip())[1:-1]]


@dataclass(frozen=True)
class Table:
    """A table: the heading above it, the name that the paragraph before begins with, its first line
    and the others.
    """

    heading: str
    name: str
    header: list
    rows: list


def tables_of(page):
    """The tables of a page, in order."""
    found, heading, name, lines = [], "", "", []
    for line in [*page.read_text(encoding="utf-8").splitlines(), ""]:
        if line.startswith("|"):
            lines.append(cells_of(line))
            continue
        if lines:
            found.append(Table(heading, name, lines[0], lines[2:]))
            lines = []
        if line.startswith("#"):
            heading = line.lstrip("# ")
        elif word := re.match(r"`(\w+)`:", line):
            name = word[1]
    return found


def table(pages, *words):
    """The only table of these pages whose heading and first line hold all these words."""
    (found,) = (
        t for page in pages for t in tables_of(page) if {t.heading, *t.header} >= set(words)
    )
    return found.rows


def claims():
    """The rows of the page on verification that have a command, as (first cell, command)."""
    tables = [t for t in tables_of(DOCS / "verification.md") if "command" in t.header]
    found = [dict(zip(t.header, row, strict=True)) for t in tables for row in t.rows]
    return [(row["what"], row["command"]) for row in found]


def test_evidence():
    """Each table of numbers is a claim's, with a command that makes it again."""
    linked = {name for what, _ in claims() for name in re.findall(r"\(evidence/([\w.]+)\)", what)}
    assert linked == {path.name for path in (DOCS / "evidence").iterdir()}


@pytest.mark.parametrize("command", sorted(set(re.findall(r"`(.+?)`", str(claims())))))
def test_commands_of_claims(command, monkeypatch, capsys):
    """They are there and begin: programs print their usage, tests and targets of make are found."""
    words = command.split()
    if words[0] == "make":
        assert f"\n{words[1]}:" in (ROOT / "Makefile").read_text(encoding="utf-8")
        return
    assert words.pop(0) == "python3"
    module = words[1] if words[0] == "-m" else None
    if module == "pytest":
        assert (ROOT / words[-1]).is_file()
        return
    monkeypatch.chdir(ROOT)
    monkeypatch.setattr(sys, "path", [str((ROOT / words[0]).parent), *sys.path])
    monkeypatch.setattr(sys, "argv", ["program", "--help"])
    for name in (module, f"{module}.__main__"):  # another test may have imported it
        monkeypatch.delitem(sys.modules, name, raising=False)
    run = partial(runpy.run_module, module) if module else partial(runpy.run_path, words[0])
    with pytest.raises(SystemExit) as end:
        run(run_name="__main__")
    assert end.value.code == 0
    assert "usage: " in capsys.readouterr().out


MODELS = {
    ("Top level", "key"): [scene.Scene],
    ("`[mesh]` from a generator", "key"): [scene.MeshGenerator],
    ("`[mesh]` from a file", "key"): [MeshFile],
    ("`[element]`", "key"): [scene.Element],
    ("`[[material]]`", "key"): [LinearElastic, OrthotropicElastic],
    ("`[[material]]`", "key of `orthotropic`"): [Orthotropic],
    ("Nonlinear materials", "key of a nonlinear `law`"): [
        NeoHooke,
        SaintVenantKirchhoff,
        MooneyRivlin,
        Ogden,
        J2,
        Maxwell,
    ],
    ("`[[displacement]]`", "key"): [displacement.Displacement],
    ("Loads", "key"): [
        loads.Traction,
        loads.Force,
        loads.Fluid,
        loads.BodyForce,
        loads.Gravity,
        loads.Rotation,
        loads.Temperature,
        loads.Preload,
        loads.PointForce,
    ],
    ("`[[springs]]`", "key"): [loads.Springs],
    ("`[[contact]]`", "key"): [contact.Contact],
    ("`[[contact]]`", "key of `friction`"): [NoFriction, Tresca, Coulomb, Stribeck, SpeedTable],
    ("`[[contact]]`", "key of `overclosure`"): [Overclosure],
    ("`[[contact]]`", "key of `wear`"): [Archard],
    ("Rigid bodies", "key"): [RigidMotion],
    ("Two bodies", "key of `body`"): [scene.Body],
    ("Two bodies", "key of `general_contact`"): [contact.GeneralContact],
    ("`[load_steps]`", "key"): [LoadSteps],
    ("`[solver]`", "key"): [settings.SolverSettings],
    ("`[accuracy]`", "key"): [settings.Accuracy],
    ("`[units]`", "key"): [settings.Units],
}


def classes_in(annotation):
    """The models in an annotation, and in theirs."""
    if inspect.isclass(annotation) and issubclass(annotation, BaseModel):
        inner = (classes_in(field.annotation) for field in annotation.model_fields.values())
        return {annotation}.union(*inner)
    return set().union(*(classes_in(argument) for argument in get_args(annotation)))


def literals_in(annotation):
    """The words that an annotation allows."""
    if get_origin(annotation) is Literal:
        return {word for word in get_args(annotation) if isinstance(word, str)}
    return set().union(*(literals_in(argument) for argument in get_args(annotation)))


def shown_default(default):
    """How the pages write a default."""
    match default:
        case None | (float(), float()):
            return "none"
        case NoFriction():
            return '`{ law = "none" }`'
        case BaseModel():
            return "see below"
    text = (
        "[]"
        if default == ()
        else repr(default)
        if isinstance(default, float)
        else json.dumps(default)
    )
    return f"`{text.replace('1e-07', '1e-7')}`"


def test_every_class_has_a_table():
    """Walked from the scene."""
    found = classes_in(model := described())
    assert found - {Heat, InitialTemperature, Inertia, InitialVelocity} == {model}.union(
        *MODELS.values()
    ) - {
        scene.Scene,
        RigidMotion,
        Archard,  # of files that are imported where a scene names them
        Stribeck,
        SpeedTable,
    }


@pytest.mark.parametrize("place", MODELS, ids=" ".join)
def test_scene_keys(place):
    """Every key, its default, and every word that it allows."""
    found = {}
    for model in MODELS[place]:
        for key, field in model.model_fields.items():
            found.setdefault(f"`{key}`", []).append(field)
    rows = table(MANUAL, *place)
    assert sorted(row[0] for row in rows) == sorted(found)
    for key, default, *_unit, meaning in rows:
        first = found[key][0]
        assert default == ("required" if first.is_required() else shown_default(first.default)), key
        words = set().union(*(literals_in(field.annotation) for field in found[key]))
        said = [default, meaning, *(row[-1] for row in rows if row[0] in meaning)]  # "as `x`"
        assert {word for word in words if f'"{word}"' not in " ".join(said)} == set(), key


def test_generators():
    """Every generator with all of its boundaries; its parameters are those of its docstring, which
    the page shows.
    """
    rows = [
        row for t in tables_of(DOCS / "meshes.md") if t.header[0] == "generator" for row in t.rows
    ]
    known = known_generators()
    assert sorted(re.match(r"\[(\w+)\]", row[0])[1] for row in rows) == list(known)
    for link, _body, boundaries in rows:
        name = re.match(r"\[(\w+)\]", link)[1]
        returns = inspect.getdoc(known[name]()).partition("Returns:")[2]
        assert set(boundaries.split(", ")) - set(re.findall(r"\w+", returns)) == set(), name


@pytest.mark.parametrize("key", ["algorithm", "coulomb", "linear_algebra"])
def test_how_to_choose(key):
    """Every word of these keys has a line that says when to take it."""
    shown = set(re.findall(r"\w[\w-]*", " ".join(row[0] for row in table(MANUAL, f"`{key}`"))))
    words = literals_in(settings.SolverSettings.model_fields[key].annotation)
    assert (words or set(settings.known_linear_algebra())) <= shown


def test_public_names():
    """The guides together, and the API reference alone, name all that the package exports."""
    for pages in (MANUAL, [DOCS / "api.md"]):
        words = set().union(
            *(re.findall(r"\w+", page.read_text(encoding="utf-8")) for page in pages)
        )
        assert set(signorini_fx.__all__) - words == set(), pages


def test_returned_classes():
    """The API reference has each class that what it has returns, and that a solution has as an
    attribute.
    """
    page = (DOCS / "api.md").read_text(encoding="utf-8")
    listed = re.findall(r"(?m)^   ~?([\w.]+)$", page)
    package = Path(signorini_fx.__file__).parent
    ours = {
        name
        for file in package.rglob("*.py")
        for name in re.findall(r"(?m)^class (\w+)", file.read_text())
    }
    inner = {
        "ActingForces",
        "FormSolver",
        "ContactBoundary",
        "ContactPart",
        "LoadCase",
        "Task",
        "Posed",
        "Report",
        "Mechanics",
        "Model",
        "Shape",
        "Statement",
        "StressRecovery",
    }  # what the solver works with
    for entry in listed:
        module, _, name = entry.rpartition(".")
        shown = getattr(
            importlib.import_module(f"signorini_fx.{module}") if module else signorini_fx, name
        )
        members = (
            [member for key, member in vars(shown).items() if key[0] != "_"]
            if inspect.isclass(shown)
            else [shown]
        )
        plain = [
            getattr(member, "fget", None) or getattr(member, "func", member) for member in members
        ]
        returned = [getattr(member, "__annotations__", {}).get("return", "") for member in plain]
        if name in ("Solution", "StepResult"):
            returned += shown.__annotations__.values()
        named = set(re.findall(r"[A-Z]\w+", " ".join(map(str, returned))))
        assert named & ours - inner - {one.rpartition(".")[2] for one in listed} == set(), entry


# --- results --------------------------------------------------------------------------------------


def test_outcomes():
    """Every status with its text."""
    rows = table(MANUAL, "`Status`")
    assert [(row[0].strip("`"), row[1]) for row in rows] == [
        (status.name, status.value) for status in Status
    ]
    assert all(row[2] and (row[3] or row[0] == "`CONVERGED`") for row in rows)


def test_symptoms():
    """What a first run is said to print, in italics, is a text of the package; ``...`` and numbers
    stand for others.
    """
    package = "".join(
        path.read_text(encoding="utf-8") for path in sorted((ROOT / "signorini_fx").rglob("*.py"))
    )
    package = re.sub(r'"\s*\n\s*f?"', "", package)
    symptoms = [
        row[0] for row in table([DOCS / "outcomes.md"], "My first run failed", "what you see")
    ]
    quoted = [text for symptom in symptoms for text in re.findall(r"\*([^*]+)\*", symptom)]
    assert len(quoted) > len(symptoms) / 2
    for text in quoted:
        for part in re.split(r"\.\.\.|'\w+'|\d+", text):
            assert part.strip() in package, text


@pytest.mark.slow
def test_results(tmp_path):
    """Every file, every key of the summary and every column, of scenes that make all of them."""
    named = set(
        re.findall(r"`([\w.]+)`", (DOCS / "results.md").read_text(encoding="utf-8") + markdown())
    )
    stepped = example1(coefficient=0.3, nx=12, ny=4)
    loads = [load.model_copy(update={"factors": (0.5, 1.0)}) for load in stepped.traction]
    kinds = {
        "steps": stepped.model_copy(update={"traction": tuple(loads)}),
        "levels": example1(bound=1.5, nx=12, ny=4, levels=2),
        "path": example1(bound=1.5, nx=12, ny=4, algorithm="path-following"),
    }
    for kind, data in kinds.items():
        folder = tmp_path / kind
        summary = write_results(
            alone(data), folder, pictures=kind == "levels", fields=kind == "levels"
        )
        written = {file.name for file in folder.iterdir()}
        assert {name for name in written if not {name, Path(name).stem} & named} == set()
        assert {*summary, *summary["parameters"], *summary["zones"]} - named == set()
        for file in folder.glob("*.csv"):
            with file.open(encoding="utf-8") as text:
                assert set(next(csv.reader(text))) - named == set(), file.name


def test_certificate():
    """Every figure, in theory.md."""
    shown = [row[0].strip("`") for row in table([THEORY], "figure", "judged")]
    assert sorted(shown) == sorted((*JUDGED, *REPORTED))


# --- code -----------------------------------------------------------------------------------------


def test_code_that_is_named():
    """Modules and what is in them are there."""
    keys = {key for model in classes_in(described()) for key in model.model_fields}
    for word in set(re.findall(r"`([\w./]+)`", THEORY.read_text(encoding="utf-8"))):
        module, *path = word.split(".")
        if word.endswith(".py"):
            assert any((folder / word).is_file() for folder in (ROOT, ROOT / "signorini_fx")), word
        elif module in MODULES and path and path[0] not in keys:
            found = importlib.import_module(f"signorini_fx.{module}")
            for name in path:
                found = getattr(found, name)
