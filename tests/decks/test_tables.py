"""Results at the nodes of a deck: tables as CalculiX prints them, and the file for cgx."""

import re

import numpy as np
import pytest
from deck_lines import POISSON, STEEL, YOUNG, stacked

from signorini_fx.scenes import cli

PRESSURE, SLOPE = 5.0, 1e4


def tables(text):
    """Heading -> number of the node -> values."""
    found = {}
    for line in text.splitlines():
        if match := re.match(r" (\S.* time +0\.\d{7}E[+-]\d\d)$", line):
            rows = found.setdefault(match[1], {})
        elif re.match(r" {8,9}-?\d\.", line):
            rows[0] = [float(line[k : k + 14]) for k in range(7, len(line), 14)]
        elif re.match(r" +\d+ [ -]\d\.", line):
            rows[int(line[:10])] = [float(line[k : k + 14]) for k in range(10, len(line), 14)]
    return found


def solved(folder, lines, *options):
    """The tables, and the text of the file for cgx."""
    deck = folder / "deck.inp"
    deck.write_text("\n".join(lines) + "\n")
    arguments = ["run", str(deck), "--out", str(folder / "out"), "--no-pictures", "--no-fields", "--quiet", *options]
    assert cli.main(arguments) == 0
    if not (folder / "out" / "deck.dat").exists():
        return None
    return tables((folder / "out" / "deck.dat").read_text()), (folder / "out" / "deck.frd").read_text()


def test_tables_that_are_asked_for_before_the_steps(tmp_path):
    """They are those of each step."""
    lines = stacked(["*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR", f"{SLOPE}"])
    at = lines.index("*STEP")
    lines[at:at] = ["*NODE PRINT, NSET=UP_HEAD", "U"]
    found, _ = solved(tmp_path, lines)
    assert list(found) == ["displacements (vx,vy,vz) for set UP_HEAD and time  0.1000000E+01"]


def test_two_blocks(tmp_path):
    """One above the other under pressure, with soft contact: the exact solution at the nodes of the deck."""
    lines = stacked(["*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR", f"{SLOPE}"])
    lines[-1:] = ["*NODE PRINT, NSET=UP_HEAD", "U, RF", "*NODE PRINT, NSET=LOW_FEET, TOTALS=ONLY", "RF"]
    lines += ["*CONTACT PRINT", "CDIS, CSTR", "*END STEP"]
    found, cgx = solved(tmp_path, lines)
    time = "time  0.1000000E+01"
    everywhere = "for all contact elements and time 0.1000000E+01"
    assert list(found) == [
        f"displacements (vx,vy,vz) for set UP_HEAD and {time}",
        f"forces (fx,fy,fz) for set UP_HEAD and {time}",
        f"total force (fx,fy,fz) for set LOW_FEET and {time}",
        f"relative contact displacement (slave node,normal,tang1,tang2) {everywhere}",
        f"contact stress (slave node,press,tang1,tang2) {everywhere}",
    ]
    displaced, forces, total, apart, stress = found.values()
    assert list(displaced) == list(forces) == [111, 112, 113, 114, 115]
    sinks = 2 * PRESSURE * (1 - POISSON**2) / YOUNG + PRESSURE / SLOPE
    np.testing.assert_allclose([y[1] for y in displaced.values()], -sinks, rtol=1e-5)
    np.testing.assert_allclose([f[1] for f in forces.values()], -PRESSURE * np.array([1, 2, 2, 2, 1]) / 8, rtol=1e-6)
    np.testing.assert_allclose(total[0][1], PRESSURE, rtol=1e-6)
    assert list(apart) == list(stress) == [101, 102, 103, 104, 105]
    np.testing.assert_allclose([u[0] for u in apart.values()], -PRESSURE / SLOPE, rtol=1e-5)
    np.testing.assert_allclose([p[0] for p in stress.values()], PRESSURE, rtol=1e-5)
    assert len(re.findall("^ -4", cgx, re.MULTILINE)) == 4
    values = np.array([[float(line[k : k + 12]) for k in (13, 25)] for line in cgx.split(" -4  STRESS")[1].splitlines()
                       if line.startswith(" -1")][:30])  # fmt: skip
    np.testing.assert_allclose(values[:, 1], -PRESSURE, rtol=1e-4)


def test_steps_that_are_left_out(tmp_path):
    """A step that is not static has no tables, and those of later ones are theirs, with their numbers."""
    lines = stacked(["*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR", f"{SLOPE}"])
    lines[-1:] = ["*NODE PRINT, NSET=UP_HEAD", "U", "*END STEP"]
    lines += ["*STEP", "*FREQUENCY", "3", "*NODE PRINT, NSET=LOW_HEAD", "U", "*END STEP"]
    lines += ["*STEP", "*STATIC", "*DSLOAD", "UP_TOP, P, 10.0", "*NODE PRINT, NSET=UP_FEET", "U", "*END STEP"]
    deck = tmp_path / "deck.inp"
    deck.write_text("\n".join(lines) + "\n")
    code = cli.main(["run", str(deck), "--out", str(tmp_path / "out"), "--no-pictures", "--no-fields", "--quiet"])
    assert code == 4  # the step is lost
    text = (tmp_path / "out" / "deck.dat").read_text()
    assert re.findall(r"S T E P +(\d+)", text) == ["1", "3"]
    first, last = tables(text).items()
    assert "UP_HEAD" in first[0]
    assert "UP_FEET" in last[0]
    sinks = (PRESSURE * (1 - POISSON**2) / YOUNG + PRESSURE / SLOPE) * 2
    np.testing.assert_allclose([y[1] for y in last[1].values()], -sinks, rtol=1e-5)
    assert re.findall(r"(?m)^    1PSTEP.* (\d+)$", (tmp_path / "out" / "deck.frd").read_text()) == ["1"] * 4 + ["3"] * 4


def test_tables_of_all_nodes(tmp_path):
    """*NODE PRINT without a set is of all nodes; a traceback before."""
    lines = stacked(["*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR", f"{SLOPE}"])
    lines[-1:] = ["*NODE PRINT", "U, RF", "*END STEP"]
    printed, _ = solved(tmp_path, lines)
    assert [set(rows) for rows in printed.values()] == [{*range(1, 16), *range(101, 116)}] * 2


@pytest.mark.slow
def test_a_last_step_without_an_end(tmp_path):
    """The file ends it: its tables are the same."""
    lines = stacked(["*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR", f"{SLOPE}"])
    lines[-1:] = ["*NODE PRINT, NSET=UP_HEAD", "U"]
    open_, cgx = solved(tmp_path, lines)
    assert open_
    (tmp_path / "closed").mkdir()
    assert solved(tmp_path / "closed", [*lines, "*END STEP"]) == (open_, cgx)


@pytest.mark.one_quick
@pytest.mark.parametrize("kind", ["C3D8", "C3D20"])
def test_a_column_in_space(tmp_path, kind):
    """Pulled at its top, in two steps: results of both at their times, and reactions that balance the load, also of
    elements that get nodes in the middle of their faces.
    """
    at = [(x, y, z) for z in (0, 1, 2, 3, 4) for y in (0, 1, 2) for x in (0, 1, 2)]
    middles = kind == "C3D20"
    number = {p: n for n, p in enumerate(at, 1) if middles or not any(k % 2 for k in p)}
    lines = ["*NODE", *(f"{n}, {x / 2}, {y / 2}, {z / 2}" for (x, y, z), n in number.items())]
    corners = [(0, 0, 0), (2, 0, 0), (2, 2, 0), (0, 2, 0), (0, 0, 2), (2, 0, 2), (2, 2, 2), (0, 2, 2)]
    edges = [(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)]
    whole = corners + [tuple((a + b) // 2 for a, b in zip(corners[i], corners[j], strict=True)) for i, j in edges]
    lines += [f"*ELEMENT, TYPE={kind}, ELSET=ALL"]
    for element in (1, 2):
        nodes = [number[x, y, z + 2 * element - 2] for x, y, z in (whole if middles else corners)]
        words = ", ".join(map(str, [element, *nodes]))
        lines += [words] if not middles else [", ".join(words.split(", ")[:11]), ", ".join(words.split(", ")[11:])]
    lines = [line + "," if middles and line.count(",") == 10 else line for line in lines]
    feet = [n for (x, y, z), n in number.items() if z == 0 and not x % 2 == y % 2 == 1]
    lines += ["*NSET, NSET=FEET", *map(str, feet), "*SURFACE, NAME=TOP", "2, S2", *STEEL]
    lines += ["*SOLID SECTION, ELSET=ALL, MATERIAL=STEEL", "*BOUNDARY", "FEET, 1, 3"]
    for force in (3.0, 7.0):
        lines += ["*STEP", "*STATIC", "0.5, 0.5", "*DSLOAD", f"TOP, P, {-force}"]
        lines += ["*NODE PRINT, NSET=FEET, TOTALS=YES", "RF", "*END STEP"]
    found, cgx = solved(tmp_path, lines)
    totals = [table[0] for name, table in found.items() if name.startswith("total")]
    np.testing.assert_allclose(totals, [[0.0, 0.0, -3.0], [0.0, 0.0, -7.0]], atol=1e-9)
    assert [name[-13:] for name in found] == [*["0.5000000E+00"] * 2, *["0.1000000E+01"] * 2]
    nodal = [np.array(list(table.values())) for name, table in found.items() if name.startswith("forces")]
    np.testing.assert_allclose(nodal[1].sum(axis=0), [0.0, 0.0, -7.0], atol=1e-5)
    assert [len(table) for table in nodal] == [len(feet)] * 2
    first = cgx.split("    3C")[1].splitlines()[2:]
    if middles:  # those on upright edges before those on top
        assert first[1].split()[1:] == [str(number[p]) for p in whole[10:12] + whole[16:20] + whole[12:16]]


def test_a_state_of_shear_in_space(tmp_path):
    """A cube under the tractions of a uniform stress has it at all of its nodes, each component in its column."""
    stress = np.array([[1.0, 4.0, 6.0], [4.0, 2.0, 5.0], [6.0, 5.0, 3.0]])
    corners = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
    lines = ["*NODE", *(f"{n}, {x}., {y}., {z}." for n, (x, y, z) in enumerate(corners, 1))]
    lines += ["*ELEMENT, TYPE=C3D8, ELSET=ALL", "1, 1, 2, 3, 4, 5, 6, 7, 8", *STEEL]
    lines += ["*SOLID SECTION, ELSET=ALL, MATERIAL=STEEL"]
    normals = {"S1": (0, 0, -1), "S2": (0, 0, 1), "S3": (0, -1, 0), "S4": (1, 0, 0), "S5": (0, 1, 0), "S6": (-1, 0, 0)}
    for face in normals:
        lines += [f"*SURFACE, NAME=F{face}", f"1, {face}"]
    lines += ["*BOUNDARY", "1, 1, 3", "2, 2, 3", "4, 3", "*STEP", "*STATIC", "*DSLOAD"]
    for face, normal in normals.items():
        traction = stress @ normal
        lines.append(f"F{face}, TRVEC, {float(np.linalg.norm(traction))!r}, {', '.join(map(repr, traction.tolist()))}")
    _, cgx = solved(tmp_path, [*lines, "*END STEP"])
    block = cgx.split(" -4  STRESS")[1].split(" -3")[0].splitlines()
    assert [line.split()[1] for line in block if line.startswith(" -5")] == ["SXX", "SYY", "SZZ", "SXY", "SYZ", "SZX"]
    rows = [[float(line[k : k + 12]) for k in range(13, 85, 12)] for line in block if line.startswith(" -1")]
    assert len(rows) == len(corners)
    np.testing.assert_allclose(rows, [[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]] * len(corners), rtol=1e-5)


@pytest.mark.slow
def test_the_order_of_nodes(tmp_path):
    """That of their numbers, whatever the order of the set and of the nodes in the file."""
    lines = stacked(["*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=HARD"])
    first, second = lines.index("*NODE"), lines.index("*ELEMENT, TYPE=CPE4, ELSET=LOW")
    lines[first + 1 : second] = lines[second - 1 : first : -1]
    at = lines.index("*STEP")
    lines[at:at] = ["*NSET, NSET=SOME, UNSORTED", "13, 2, 101, 7", "3"]
    lines[-1:] = ["*NODE PRINT, NSET=SOME", "U", "*END STEP"]
    (moved,), _ = (list(part.values()) if isinstance(part, dict) else part for part in solved(tmp_path, lines))
    assert list(moved) == [2, 3, 7, 13, 101]
    sinks = PRESSURE * (1 - POISSON**2) / YOUNG
    heights = np.array([0.0, 0.0, 0.5, 1.0, 1.0])
    np.testing.assert_allclose([y[1] for y in moved.values()], -sinks * heights, rtol=1e-4)


@pytest.mark.slow
def test_forces_of_a_body_of_revolution(tmp_path):
    """Those of a sector of 2 degrees, as CalculiX prints them: of a ring under pressure its share of the force."""
    lines = [
        "*NODE",
        "1, 1., 0.",
        "2, 2., 0.",
        "3, 2., 1.",
        "4, 1., 1.",
        "*ELEMENT, TYPE=CAX4, ELSET=E",
        "1, 1, 2, 3, 4",
    ]
    lines += [*STEEL, "*SOLID SECTION, ELSET=E, MATERIAL=STEEL", "*NSET, NSET=LOW", "1, 2", "*BOUNDARY", "LOW, 2"]
    lines += [
        "*STEP",
        "*STATIC",
        "*DLOAD",
        f"1, P3, {PRESSURE}",
        "*NODE PRINT, NSET=LOW, TOTALS=YES",
        "RF",
        "*END STEP",
    ]
    found, _ = solved(tmp_path, lines)
    nodal, total = found.values()
    # Areas of the ring that its nodes have: the integrals of 2 pi r (2 - r) and 2 pi r (r - 1) from 1 to 2.
    shares = np.array([[2 / 3], [5 / 6]]) * 2 * np.pi * PRESSURE * 2 / 360
    np.testing.assert_allclose([nodal[1][1], nodal[2][1]], shares.ravel(), rtol=1e-6)
    np.testing.assert_allclose(total[0][1], shares.sum(), rtol=1e-6)


def test_triangles_beside_quadrilaterals(tmp_path):
    """Cells are divided: even forces at the nodes of a side are an even traction, and what nodes between those of the
    file bear is told at these.
    """
    nodes = [f"{1 + i + 4 * j}, {0.5 * i}, {0.4 * j}" for j in range(3) for i in range(4)]
    lines = ["*NODE", *nodes, "*ELEMENT, TYPE=CPE4, ELSET=BODY", "1, 1, 2, 6, 5", "2, 2, 3, 7, 6", "3, 5, 6, 10, 9"]
    lines += ["4, 6, 7, 11, 10", "5, 3, 4, 8, 7", "*ELEMENT, TYPE=CPE3, ELSET=BODY", "6, 7, 8, 12", "7, 7, 12, 11"]
    lines += ["*NSET, NSET=FEET", "1, 2, 3, 4", "*NSET, NSET=INNER", "10, 11", "*NSET, NSET=ENDS", "9, 12"]
    lines += ["*NSET, NSET=HEAD", "9, 10, 11, 12", "*SOLID SECTION, ELSET=BODY, MATERIAL=STEEL", *STEEL]
    lines += ["*BOUNDARY", "FEET, 1, 2", "*STEP", "*STATIC", "*CLOAD", "ENDS, 2, -0.5", "INNER, 2, -1", "ENDS, 1, 0.1"]
    lines += ["*NODE PRINT, NSET=FEET", "RF", "*NODE PRINT, NSET=HEAD", "RF", "*END STEP"]
    feet, head = (np.array(list(rows.values())) for rows in solved(tmp_path, lines)[0].values())
    np.testing.assert_allclose(feet.sum(axis=0), [-0.2, 3.0, 0.0], atol=1e-6)
    np.testing.assert_allclose(head, [[0.1, -0.5, 0], [0, -1, 0], [0, -1, 0], [0.1, -0.5, 0]], atol=1e-6)
