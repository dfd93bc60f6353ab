"""``signorini-fx run``: from a deck to a report, with an exit code for what was left out."""

import json

import pytest
from deck_lines import STEEL, squares, stacked

from signorini_fx.scenes import cli


def run(folder, lines, capsys, *options):
    """The exit code and what was printed; results are in ``out``."""
    deck = folder / "deck.inp"
    deck.write_text("\n".join(lines) + "\n")
    code = cli.main(["run", str(deck), "--out", str(folder / "out"), "--no-pictures", "--no-fields", *options])
    said = capsys.readouterr()
    return code, said.out + said.err


def test_a_whole_deck(tmp_path, capsys):
    """It is solved, and has a report; run again after an edit of the deck it is drafted anew, unless the draft was
    edited, too.
    """
    code, said = run(tmp_path, stacked([]), capsys)
    assert code == 0
    assert "changes the answer" not in said
    assert "What was left out" not in (tmp_path / "out" / "report.html").read_text()
    assert run(tmp_path, stacked([]), capsys, "--quiet") == (0, "")
    code, said = run(tmp_path, [line.replace("P, 5.0", "P, 6.0") for line in stacked([])], capsys)
    assert code == 0
    draft = tmp_path / "out.toml"
    assert "pressure = 6.0" in draft.read_text()
    draft.write_text(draft.read_text() + "# completed\n")
    code, said = run(tmp_path, stacked([]), capsys)
    assert code == 2
    assert "is no draft or was edited: solve it, or remove it" in " ".join(said.split())
    assert draft.read_text().endswith("# completed\n")


@pytest.mark.slow
@pytest.mark.parametrize("options", [(), ("--quiet",)])
def test_what_changes_the_answer(tmp_path, capsys, options):
    """It has an exit code of its own, and is red in the report; what does not change it is told as such."""
    lines = stacked(["*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=MASSLESS", "1e-4, .1"])
    lines.insert(-1, "*FILM")
    code, said = run(tmp_path, lines, capsys, *options)
    assert code == 4
    if not options:
        assert "changes the answer: line" in said
        assert "does not change it: line" in said
    assert "left out of the deck: 1 thing that changes the answer" in " ".join(said.split())
    page = (tmp_path / "out" / "report.html").read_text()
    assert '<div class="status bad">' in page
    assert "MASSLESS: soft contact is read as LINEAR or TIED only: this contact is hard</li>" in page
    assert json.loads((tmp_path / "out" / "summary.json").read_text())["converged"]


def test_a_deck_without_its_contact(tmp_path, capsys):
    """It is another problem: nothing is solved, and the draft is there to be completed."""
    lines = ["UP_BOTTOM, NOWHERE" if line == "UP_BOTTOM, LOW_TOP" else line for line in stacked([])]
    code, said = run(tmp_path, lines, capsys)
    assert code == 4
    assert "not solved, as all contact of the deck is left out: complete" in " ".join(said.split())
    assert not (tmp_path / "out").exists()
    assert (tmp_path / "out.toml").exists()


def test_decks_that_cannot_be_read(tmp_path, capsys):
    """One error, and nothing is written."""
    code, said = run(tmp_path, ["*NODE", "1, 0.0, nothing"], capsys)
    assert code == 2
    assert "line 1" in said
    assert sorted(file.name for file in tmp_path.iterdir()) == ["deck.inp"]
    assert cli.main(["run", str(tmp_path / "deck.txt"), "--out", str(tmp_path / "out")]) == 2


def beams(load, pair="*CONTACT PAIR, INTERACTION=I"):
    """A slender cantilever on another one, under a pressure."""
    lines = [*squares(16, 1, name="LOW", size=(20.0, 1.0))]
    lines += squares(16, 1, 201, corner=(0.0, 1.0), size=(20.0, 1.0), name="UP")
    lines += [f"*SOLID SECTION, ELSET={name}, MATERIAL=STEEL" for name in ("LOW", "UP")]
    lines += [*STEEL, "*SURFACE INTERACTION, NAME=I", pair, "UP_BOTTOM, LOW_TOP", "*BOUNDARY"]
    lines += ["LOW_WALL, 1, 2", "UP_WALL, 1, 2", "*STEP, NLGEOM", "*STATIC", "*DSLOAD", f"UP_TOP, P, {load}"]
    return [*lines, "*END STEP"]


@pytest.mark.slow
def test_finite_strains(tmp_path, capsys):
    """NLGEOM makes strains finite, and sides slide."""
    code, _ = run(tmp_path, beams(0.02), capsys)
    assert code == 0
    draft = (tmp_path / "out.toml").read_text()
    assert 'law = "saint-venant-kirchhoff"' in draft
    assert "sliding" not in draft.partition("[mesh]")[2]
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert summary["converged"]
    assert summary["incomplete"] == []


@pytest.mark.slow
def test_sides_that_keep_their_partners(tmp_path, capsys):
    """With ADJUST sides do not slide, which is named."""
    lines = beams(0.002, "*CONTACT PAIR, INTERACTION=I, ADJUST=0.01")
    code, said = run(tmp_path, lines, capsys)
    assert code == 4
    assert 'sliding = "small"' in (tmp_path / "out.toml").read_text()
    at = lines.index("*STEP, NLGEOM") + 1
    assert f"changes the answer: line {at}, *STEP: NLGEOM: points in contact keep" in " ".join(said.split())
