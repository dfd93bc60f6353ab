"""From a deck to a result, with an exit code for what was left out."""

import pytest
from commands import summary_in
from deck_lines import STEEL, squares, stacked

from signorini_fx.scenes import cli


def drafted(folder, lines, capsys):
    """The exit code and what was printed; the scene is in ``draft.toml``."""
    deck = folder / "deck.inp"
    deck.write_text("\n".join(lines) + "\n")
    code = cli.main(["new", str(folder / "draft.toml"), "--from", str(deck)])
    printed = capsys.readouterr()
    return code, " ".join((printed.out + printed.err).split())


def solved(folder, capsys, *options):
    """The exit code and what was printed; results are in ``out``."""
    files = [str(folder / "draft.toml"), "--out", str(folder / "out")]
    code = cli.main(["solve", *files, "--no-pictures", "--no-fields", *options])
    printed = capsys.readouterr()
    return code, " ".join((printed.out + printed.err).split())


def test_a_whole_deck(tmp_path, capsys):
    """It is solved; a draft overwrites no file."""
    code, printed = drafted(tmp_path, stacked([]), capsys)
    assert code == 0, printed
    assert "changes the answer" not in printed
    assert solved(tmp_path, capsys, "--quiet") == (0, "")
    text = (tmp_path / "draft.toml").read_text()
    code, printed = drafted(
        tmp_path, [line.replace("P, 5.0", "P, 6.0") for line in stacked([])], capsys
    )
    assert code == 2
    assert "already exists: give another name, or remove it" in printed
    assert (tmp_path / "draft.toml").read_text() == text


@pytest.mark.slow
@pytest.mark.parametrize("options", [(), ("--quiet",)])
def test_what_changes_the_answer(tmp_path, capsys, options):
    """It has an exit code of its own, and is red in the report; what does not change it is named as
    such.
    """
    lines = stacked(["*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=MASSLESS", "1e-4, .1"])
    lines.insert(-1, "*FILM")
    code, printed = drafted(tmp_path, lines, capsys)
    assert code == 4, printed
    assert "changes the answer: line" in printed
    assert "does not change the answer: line" in printed
    code, printed = solved(tmp_path, capsys, *options)
    assert code == 4, printed
    assert (
        "the scene lacks 1 item, listed under incomplete: these are not the results of your model"
        in printed
    )
    assert cli.main(["report", str(tmp_path / "out")]) == 0
    page = (tmp_path / "out" / "report.html").read_text()
    assert '<div class="status bad">' in page
    assert (
        "MASSLESS: soft contact is read as LINEAR or TIED only: this contact is hard</li>" in page
    )
    assert summary_in(tmp_path / "out")["converged"]


def test_a_deck_without_its_contact(tmp_path, capsys):
    """It is another problem."""
    lines = ["UP_BOTTOM, NOWHERE" if line == "UP_BOTTOM, LOW_TOP" else line for line in stacked([])]
    code, printed = drafted(tmp_path, lines, capsys)
    assert code == 4, printed
    assert "changes the answer: all of its contact: bodies do not touch in the scene" in printed
    assert solved(tmp_path, capsys)[0] in (1, 4)


def test_decks_that_cannot_be_read(tmp_path, capsys):
    """One error, and nothing is written."""
    code, printed = drafted(tmp_path, ["*NODE", "1, 0.0, nothing"], capsys)
    assert code == 2
    assert "line 1" in printed
    assert sorted(file.name for file in tmp_path.iterdir()) == ["deck.inp"]
    assert (
        cli.main(["new", str(tmp_path / "scene.toml"), "--from", str(tmp_path / "deck.txt")]) == 2
    )


def beams(load, pair="*CONTACT PAIR, INTERACTION=I"):
    """A slender cantilever on another one, under a pressure."""
    lines = [*squares(16, 1, name="LOW", size=(20.0, 1.0))]
    lines += squares(16, 1, 201, corner=(0.0, 1.0), size=(20.0, 1.0), name="UP")
    lines += [f"*SOLID SECTION, ELSET={name}, MATERIAL=STEEL" for name in ("LOW", "UP")]
    lines += [*STEEL, "*SURFACE INTERACTION, NAME=I", pair, "UP_BOTTOM, LOW_TOP", "*BOUNDARY"]
    lines += [
        "LOW_WALL, 1, 2",
        "UP_WALL, 1, 2",
        "*STEP, NLGEOM",
        "*STATIC",
        "*DSLOAD",
        f"UP_TOP, P, {load}",
    ]
    return [*lines, "*END STEP"]


@pytest.mark.slow
def test_finite_strains(tmp_path, capsys):
    """NLGEOM makes strains finite, and sides slide."""
    assert drafted(tmp_path, beams(0.02), capsys)[0] == 0
    draft = (tmp_path / "draft.toml").read_text()
    assert 'law = "saint-venant-kirchhoff"' in draft
    assert "sliding" not in draft.partition("[mesh]")[2]
    assert solved(tmp_path, capsys)[0] == 0
    summary = summary_in(tmp_path / "out")
    assert summary["converged"]
    assert summary["incomplete"] == []


def test_sides_that_keep_their_partners(tmp_path, capsys):
    """With ADJUST sides do not slide, which is named."""
    lines = beams(0.002, "*CONTACT PAIR, INTERACTION=I, ADJUST=0.01")
    code, printed = drafted(tmp_path, lines, capsys)
    assert code == 4, printed
    assert 'sliding = "small"' in (tmp_path / "draft.toml").read_text()
    at = lines.index("*STEP, NLGEOM") + 1
    assert f"changes the answer: line {at}, *STEP: NLGEOM: points in contact keep" in printed
