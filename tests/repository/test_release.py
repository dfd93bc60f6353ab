"""The paper, and what a release needs: claims have sources that are there, and say what these say."""

import csv
import re
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAPER, CHECKLISTS = ROOT / "paper" / "paper.md", ROOT / "docs" / "checklists.md"
EVIDENCE = ROOT / "docs" / "evidence"
BODY = PAPER.read_text(encoding="utf-8").split("---", 2)[2]
ONLY_THE_OWNER = "to be given by the owner"


def rows(name):
    """The rows of a table of docs/evidence."""
    with (EVIDENCE / f"{name}.csv").open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def test_paper():
    """As JOSS asks: a length, sections, references that are cited and none that is not."""
    assert 750 <= len(BODY.split()) <= 1000
    sections = re.findall(r"^# (.+)$", BODY, re.MULTILINE)
    for section in ("Summary", "Statement of need", "State of the field", "Software design"):
        assert section in sections
    assert sections[-1] == "References"
    entries = re.findall(r"^@\w+\{(\w+),", (PAPER.parent / "paper.bib").read_text(encoding="utf-8"), re.MULTILINE)
    assert sorted(entries) == sorted(set(re.findall(r"@(\w+)", BODY)))


def test_sources_of_the_paper():
    """Files are there, and commands of make are targets; each table of evidence that is named is listed on the page."""
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    page = (ROOT / "docs" / "evidence.md").read_text(encoding="utf-8")
    named = re.findall(r"`([^`]+)`", BODY)
    for name in named:
        target = re.fullmatch(r"make ([a-z-]+)", name)
        if target:
            assert f"\n{target[1]}:" in makefile, name
        elif "/" in name or name.endswith(".md"):
            assert (ROOT / name.split()[0]).exists(), name
        if name.startswith("docs/evidence/"):
            assert f"({name.removeprefix('docs/')})" in page, name
    (evidence,) = re.findall(r"# Research impact statement\n(.*?)\n# Limits", BODY, re.DOTALL)
    claims = re.findall(r"^- (.*?)(?=^- |\Z)", evidence, re.MULTILINE | re.DOTALL)
    assert len(claims) == 8
    for claim in claims:
        assert re.search(r"`(make|demos|bench)[^`]*`", claim), claim


def verdicts(column):
    """How many random scenes of all tables of the second program have a verdict that holds a word."""
    count = 0
    for name in ("oracle", "oracle_bodies", "oracle_effects", "oracle_space_effects"):
        for row in rows(name):
            if column in row["verdict"]:
                count += sum(int(value) for key, value in row.items() if key != "verdict")
    return count


# What the paper says, and what the tables have.
FIGURES = {
    "of 886 attempts": lambda: f"of {rows('stability')[-1]['rows']} attempts",
    "870 ended as expected": lambda: f"{rows('stability')[-1]['as expected']} ended as expected",
    "16 in a reported failure": lambda: f"{rows('stability')[-1]['failure reported']} in a reported failure",
    "none in a wrong answer": lambda: {"0": "none in a wrong answer"}[rows("stability")[-1]["red"]],
    "judged 4,592 random scenes": lambda: f"judged {verdicts('all'):,} random scenes",
    "ten as wrong": lambda: {10: "ten as wrong"}[verdicts("WRONG")],
    "all 2,126 scenes": lambda: f"all {sum(int(row['scenes']) for row in rows('bounds')):,} scenes",
    "203 in space": lambda: f"{sum(int(row['scenes']) for row in rows('bounds_in_space'))} in space",
    "table 4 in 23 of 24": lambda: f"table 4 in {rows('paper')[2]['equal to the printed numbers'][:8]}",
    "table 5 in 27 of 34": lambda: f"table 5 in {rows('paper')[3]['equal to the printed numbers'][:8]}",
    "takes 1.09 times": lambda: f"takes {rows('performance')[1]['value']} times",
    "coulomb's 1.13 times": lambda: f"coulomb's {rows('performance')[5]['value']} times",
    "51 cpu seconds": lambda: f"{float(rows('growth_in_space')[-1]['CPU seconds']):.0f} cpu seconds",
    "6.2 gb": lambda: f"{float(rows('growth_in_space')[-1]['peak MB'].replace(' ', '')) / 1000:.1f} gb",
}


@pytest.mark.parametrize("said", FIGURES)
def test_figures_of_the_paper(said):
    """The numbers are those of the tables."""
    assert said in " ".join(BODY.lower().split())
    assert FIGURES[said]().replace("\u202f", " ") == said


def test_bounds_were_never_below_the_error():
    """Effectivities of all bounds that the paper calls guaranteed."""
    assert all(float(row["smallest effectivity"]) >= 1 for row in rows("bounds") + rows("bounds_in_space"))


def test_what_only_the_owner_can_give():
    """It is in one list, and what the paper leaves open is in it; the metadata point there."""
    page = CHECKLISTS.read_text(encoding="utf-8")
    listed = page.partition("## What only the owner can give")[2].partition("\n## ")[0]
    assert PAPER.read_text(encoding="utf-8").lower().count(ONLY_THE_OWNER) >= 4
    for place in ("CITATION.cff", ".zenodo.json", "pyproject.toml", "paper/paper.md", "CHANGELOG.md", "LICENSE"):
        assert place in listed
    for place in ("CITATION.cff", "pyproject.toml", "CONTRIBUTING.md"):
        assert "docs/checklists.md" in (ROOT / place).read_text(encoding="utf-8")
    for key in re.findall(r"`CITATION.cff` \(([^)]+)\)", listed):
        for name in re.findall(r"`([\w-]+)`", key):
            given = re.search(rf"^{name}:", (ROOT / "CITATION.cff").read_text(encoding="utf-8"), re.MULTILINE)
            assert name == "authors" or not given, f"{name} is given: it leaves the list"
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert "urls" not in project or "project.urls" not in listed


@pytest.mark.parametrize("heading", ["JOSS", "pyOpenSci"])
def test_checklists(heading):
    """Each point is answered; whoever says yes, in part or no names a file, a command or a reason."""
    section = CHECKLISTS.read_text(encoding="utf-8").partition(f"\n## {heading}\n")[2].partition("\n## ")[0]
    lines = [line for line in section.splitlines() if line.startswith("|")][2:]
    points = [[cell.strip() for cell in line.split("|")[1:-1]] for line in lines]
    assert all(len(point) == 3 and point[0] for point in points)
    for point, answer, where in points:
        assert answer in ("yes", "owner", "in part", "no"), point
        assert answer == "owner" or where or point == "no human or animal research", point
    assert {"yes", "owner"} <= {answer for _, answer, _ in points}
