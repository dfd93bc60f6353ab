"""Verdicts on friction of the last of several load steps: slip counts from the end of the step before.

The files of ``data/steps`` are of CalculiX 2.20: a block is pressed onto another one and pushed, then pulled back, with
a coefficient of friction of .3 (``press``), .21 (``slippery``) and without friction.
"""

from pathlib import Path

import pytest

from signorini_fx.addons.judging.judge import judge

DATA = Path(__file__).parent / "data" / "steps"


def verdict(result):
    return judge(DATA / "press.inp", result, compare=False)


@pytest.mark.parametrize("kind", ["dat", "frd"])
def test_a_good_result_agrees(kind):
    """Where both ends are printed, slip is judged; the largest figures are a tenth of their limits at most."""
    judgement = verdict(DATA / f"press.{kind}")
    assert judgement.word == "agrees", str(judgement)
    for name in ("wrong_way", "slip_below_bound"):
        assert judgement.figures[name]["value"] < 0.1 * judgement.figures[name]["threshold"]


@pytest.mark.parametrize(("name", "missing"), [("frictionless", 0.9), ("slippery", 0.1)])
def test_less_friction_than_the_problem_has(name, missing):
    """It slips though friction is below its bound: without friction nearly all of the work of friction is missing."""
    judgement = verdict(DATA / f"{name}.dat")
    assert judgement.word == "violates contact: slip"
    assert judgement.figures["slip_below_bound"]["value"] > missing


@pytest.mark.parametrize("kind", ["dat", "frd"])
def test_the_step_before_is_not_there(tmp_path, kind):
    """The last increment alone does not tell where slip begins: nothing is said of it."""
    text = (DATA / f"press.{kind}").read_text()
    if kind == "dat":
        text = text[text.rindex(" displacements") :]
    else:
        parts = text.split("    1PSTEP")
        text = "    1PSTEP".join((parts[0], *parts[len(parts) // 2 + 1 :]))
    (tmp_path / f"last.{kind}").write_text(text)
    judgement = verdict(tmp_path / f"last.{kind}")
    assert judgement.word == "agrees"
    for name in ("wrong_way", "slip_below_bound"):
        assert judgement.figures[name]["reason"] == "slip counts from the load step before, which is not there"


def test_a_step_before_that_is_incomplete(tmp_path):
    """Neither does one of which a node is missing."""
    lines = (DATA / "press.dat").read_text().splitlines()
    del lines[5]
    (tmp_path / "holes.dat").write_text("\n".join(lines) + "\n")
    assert verdict(tmp_path / "holes.dat").figures["wrong_way"]["value"] is None


def test_a_rigid_body_that_is_not_printed(tmp_path):
    """Both bodies are moved by the same from the first step on: the slip is the same, though no row tells where the
    rigid one was.
    """
    shift = 0.02
    deck, rows, displaced = [], [], False
    for line in (DATA / "press.inp").read_text().splitlines():
        words = line.split(",")
        if words[:2] == ["BODY_TOP_N", " 1"] and len(words) == 4:
            deck.append(f"BASE_N, 1, 1, {shift}")
            line = f"BODY_TOP_N, 1, 1, {float(words[3]) + shift!r}"
        deck.append(line)
    for line in (DATA / "press.dat").read_text().splitlines():
        words = line.split()
        if not line.strip() or not words[0].isdigit():
            displaced = line.startswith(" displacements") if line.strip() else displaced
        elif displaced and int(words[0]) >= 136:
            continue
        elif displaced:
            moved = float(words[1]) + shift
            line = f"{words[0]:>10} {moved:13.6E} {words[2]} {words[3]}"
        rows.append(line)
    (tmp_path / "moved.inp").write_text("\n".join(deck) + "\n")
    (tmp_path / "moved.dat").write_text("\n".join(rows) + "\n")
    judgement = judge(tmp_path / "moved.inp", tmp_path / "moved.dat", compare=False)
    assert judgement.word == "agrees", str(judgement)
    for name in ("wrong_way", "slip_below_bound"):
        found = judgement.figures[name]["value"]
        assert found == pytest.approx(verdict(DATA / "press.dat").figures[name]["value"], abs=1e-4)


@pytest.mark.parametrize("name", ["press_lifted", "press_above"])
def test_sides_that_were_apart_before(name):
    """A press that the step before has lifted and moved back, or that begins above its plate: what it moves along the
    plate before it touches is no slip.
    """
    judgement = judge(DATA.parent / f"{name}.inp", DATA.parent / f"{name}.dat", compare=False)
    assert judgement.word == "agrees"
    assert judgement.figures["wrong_way"]["value"] == judgement.figures["slip_below_bound"]["value"] == 0.0
    assert "since the sides touch" in judgement.figures["coefficient_to"]["reason"]
