"""Test cases of code_aster: blocks pressed together, whose answer is known, and how cases end."""

import numpy as np
import pytest
from command_cases import commands, top, two_blocks, values_text, write_case

from signorini_fx.addons.aster.grouped_mesh import GroupedMesh
from signorini_fx.addons.gauntlet.aster import CommandRun
from signorini_fx.addons.gauntlet.gauntlet import gauntlet
from signorini_fx.addons.gauntlet.outcomes import LOST, OTHER_KIND, REFUSED, WHOLE
from signorini_fx.addons.gauntlet.page import page
from signorini_fx.addons.gauntlet.sources import command_files_of
from signorini_fx.mechanics.mesh.files.raw import RawMesh

GROUPS = 'MESH = DEFI_GROUP(reuse=MESH, MAILLAGE=MESH, CREA_GROUP_NO=_F(TOUT_GROUP_MA="OUI"))\nMODEL ='


def outcome(folder, text, mail):
    """Of a case that is run in this process."""
    file = write_case(folder, text.replace("MODEL =", GROUPS, 1), mail)
    out = file.with_suffix(".out")
    out.mkdir()
    return CommandRun(file, out, lambda case: None).outcome()


def forces_text(group, component, value):
    """The text of a TEST_TABLE of the sum of the forces of supports and contact."""
    action = f'RESULTAT=RES, NOM_CHAM="REAC_NODA", INST=2.0, GROUP_NO="{group}", RESULTANTE=("{component}",)'
    table = f'TAB = POST_RELEVE_T(ACTION=_F(OPERATION="EXTRACTION", {action}))\n'
    return f'{table}TEST_TABLE(TABLE=TAB, NOM_PARA="{component}", VALE_CALC={value!r})\n'


@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("model", ["D_PLAN", "C_PLAN", "AXIS", "3D"])
def test_blocks_pressed(tmp_path, model, degree):
    """Displacement, pressure at contact, stress, and forces of supports are exact: those of a whole ring per radian."""
    up = "Z" if model == "3D" else "Y"
    tests = values_text({f"D{up}": top(model)}) + values_text({f"SI{up}{up}": -16.0}, "LOW_CORNER", "SIEF_NOEU")
    tests += forces_text(f"LOW_{up.lower()}0", f"D{up}", 8.0 if model == "AXIS" else 16.0)
    tests += values_text(
        {"LAGS_C": -16.0}, f"UP_{up.lower()}0", TYPE_TEST="MIN", REFERENCE="ANALYTIQUE", VALE_REFE=-16.0
    )
    case = outcome(tmp_path, commands(model, tests=tests), two_blocks(model, degree))
    assert (case.state, case.why) == (WHOLE, "")
    names = [quantity.name.partition(",")[0] for quantity in case.quantities]
    assert sorted(names) == ["contact pressure", "displacement", "stress", "sum of nodal forces"]
    assert case.difference < 2e-5


def test_forces_of_contact_count(tmp_path):
    """REAC_NODA has them, as loads are subtracted from the forces of the stress alone."""
    case = outcome(tmp_path, commands("D_PLAN", tests=forces_text("UP_y0", "DY", 16.0)), two_blocks("D_PLAN"))
    assert case.difference < 2e-5
    case_of_top = tmp_path / "top"
    case_of_top.mkdir()
    tests = forces_text("UP_y1", "DY", 0.0) + forces_text("LOW_y0", "DY", 16.0)
    assert outcome(case_of_top, commands("D_PLAN", tests=tests), two_blocks("D_PLAN")).difference < 2e-5


def test_instants(tmp_path):
    """Values belong to their instants, also where these are known by their numbers."""
    tests = values_text({"DY": top("D_PLAN", 8.0)}).replace("INST=2.0", "NUME_ORDRE=1") + values_text(
        {"DY": top("D_PLAN")}
    )
    case = outcome(tmp_path, commands("D_PLAN", tests=tests), two_blocks("D_PLAN"))
    assert case.difference < 2e-5
    wrong = tmp_path / "wrong"
    wrong.mkdir()
    tests = tests.replace("NUME_ORDRE=1", "NUME_ORDRE=2")
    assert outcome(wrong, commands("D_PLAN", tests=tests), two_blocks("D_PLAN")).difference == pytest.approx(
        0.5, rel=1e-4
    )


def test_a_difference(tmp_path):
    """It is explained by how theirs is solved and by our finer solution; an exact value says whose is nearer."""
    tests = values_text({"DY": 1.05 * top("D_PLAN")}, REFERENCE="ANALYTIQUE", VALE_REFE=1.01 * top("D_PLAN"))
    case = outcome(tmp_path, commands("D_PLAN", tests=tests), two_blocks("D_PLAN"))
    assert case.state == WHOLE
    (quantity,) = case.quantities
    assert quantity.difference == pytest.approx(0.05 / 1.05, rel=1e-3)
    assert quantity.exact == pytest.approx(1.01 * top("D_PLAN"))
    assert quantity.nearer == "ours"
    theirs, finer = case.reasons
    assert theirs == "theirs is contact at quadrature points (CONTINUE, AUTO)"
    assert finer.startswith("with sides half as long ours moves by")
    assert "theirs is 4.8 % from that" in finer


SLIDE = '_F(GROUP_MA="UP_x0", DX=0.0)', '_F(GROUP_MA="UP_x0", DX={})'


@pytest.mark.parametrize(
    ("slip", "contact", "state"), [(0.02, "", LOST), (0.005, "", WHOLE), (0.02, 'REAC_GEOM="SANS", ', WHOLE)]
)
def test_surfaces_that_slide(tmp_path, slip, contact, state):
    """By more than 1 % of their length: lost where code_aster's contact follows them."""
    text = commands("D_PLAN", contact, tests=values_text({"DY": top("D_PLAN")}))
    assert SLIDE[0] in text
    case = outcome(tmp_path, text.replace(SLIDE[0], SLIDE[1].format(slip)), two_blocks("D_PLAN"))
    assert case.state == state
    assert ("REAC_GEOM" in case.why) == (state == LOST)


@pytest.mark.parametrize(
    ("contact", "course", "state"),
    [
        (', GLISSIERE="OUI"', (1.0, 2.0), WHOLE),
        (', GLISSIERE="OUI"', (1.0, -1.0), LOST),  # closed, then open
        (', GLISSIERE="OUI"', (-1.0, -2.0), LOST),  # closed at the beginning only
        ("", (1.0, -1.0), WHOLE),
    ],
)
def test_contact_that_may_not_open_again(tmp_path, contact, course, state):
    """Where the solution opens what was closed, contact that stays closed has another answer."""
    text = commands(
        "D_PLAN", zone=contact, tests=values_text({"DY": 0.0}) + values_text({"DY": 0.0}).replace("2.0", "1.0")
    )
    text = text.replace('PRES_REP=_F(GROUP_MA="UP_y1", PRES=8.0)', 'DDL_IMPO=_F(GROUP_MA="UP_y1", DY=-0.001)')
    first, second = course
    text = text.replace("VALE=(0.0, 0.0, 2.0, 2.0)", f"VALE=(0.0, 0.0, 1.0, {first}, 2.0, {second})")
    case = outcome(tmp_path, text, two_blocks("D_PLAN"))
    assert case.state == state, case.why
    assert ("points open again" in case.why) == (state == LOST)


@pytest.mark.parametrize("dim", [2, 3])
def test_curvature(dim):
    """Of an arc, or of a cylinder, one over its radius; of a plane zero."""
    angles = np.linspace(0.0, 0.5, 21)
    x = np.column_stack((4.0 * np.cos(angles), 4.0 * np.sin(angles), 0.0 * angles))
    count = len(angles)
    lines = np.column_stack((np.arange(count - 1), np.arange(1, count)))
    if dim == 3:
        x = np.concatenate((x, x + np.array([0.0, 0.0, 0.1])))
        lines = np.column_stack((lines, lines[:, ::-1] + count))
    mesh = GroupedMesh(RawMesh(x, [("line" if dim == 2 else "quad", lines)]))
    marks = mesh.everything()
    assert mesh.curvature(marks) == pytest.approx(1 / 4, rel=0.3)
    mesh.points[:, 0] = 0.0
    assert mesh.curvature(marks) == pytest.approx(0.0, abs=1e-9)
    assert mesh.extent(marks) == pytest.approx(np.hypot(4.0 * np.sin(0.5), 0.1 * (dim - 2)))


@pytest.mark.parametrize(
    ("change", "state", "why"),
    [
        (('RELATION="ELAS"', 'RELATION="VMIS_ISOT_LINE"'), OTHER_KIND, "only linear elasticity"),
        (("STAT_NON_LINE", "DYNA_NON_LINE"), OTHER_KIND, "line 17, DYNA_NON_LINE: only static steps are taken"),
        (('MODELISATION="D_PLAN"', 'MODELISATION="DKT"'), REFUSED, "line 5, AFFE_MODELE: MODELISATION='DKT'"),
        (("MAT = ", "MAT == "), REFUSED, "'MAT' is not defined"),
        (("MATER=MAT", "MATER=(MAT"), REFUSED, "this is no command file"),
        (('ESCL="UP_y0"', 'ESCL="UP_y0", DIST_ESCL=RAMP'), LOST, "DIST_ESCL is not known here"),
    ],
)
def test_states(tmp_path, change, state, why):
    """What a scene has not is a row with its reason, without the folder."""
    text = commands("D_PLAN", tests=values_text({"DY": top("D_PLAN")}))
    assert change[0] in text
    case = outcome(tmp_path, text.replace(*change, 1), two_blocks("D_PLAN"))
    assert case.state == state
    assert why in case.why
    assert str(tmp_path) not in case.why


def test_several_results(tmp_path):
    """Each has its values; the worst state is that of the case."""
    text = commands("D_PLAN")
    solve = text[text.index("RES = ") : text.index("FIN()")]
    other = solve.replace("RES = ", "SOFT = ").replace("FONC_MULT=RAMP", "FONC_MULT=HALF")
    half = 'HALF = DEFI_FONCTION(NOM_PARA="INST", VALE=(0.0, 0.0, 2.0, 1.0))\n'
    tests = values_text({"DY": top("D_PLAN")}) + values_text({"DY": top("D_PLAN", 8.0)}).replace("RES,", "SOFT,")
    case = outcome(tmp_path, text.replace("FIN()", f"{half}{other}{tests}FIN()"), two_blocks("D_PLAN"))
    assert [quantity.name.partition(":")[0] for quantity in case.quantities] == ["RES", "SOFT"]
    assert case.quantities[0].ours / case.quantities[1].ours == pytest.approx(2.0, rel=1e-6)
    assert (case.state, case.difference < 2e-5) == (WHOLE, True)


def test_what_is_a_case(tmp_path):
    """Contact that is no comment, and a test."""
    text = commands("D_PLAN", tests=values_text({"DY": 1.0}))
    one = write_case(tmp_path, text, "")
    write_case(tmp_path, text.replace("CONT = DEFI", "# CONT = DEFI"), "", "comment")
    write_case(tmp_path, commands("D_PLAN"), "", "untested")
    assert list(command_files_of(tmp_path)) == [one]


def test_the_page(tmp_path):
    """A folder of command files has the page of code_aster."""
    cases = tmp_path / "cases"
    cases.mkdir()
    text = commands("D_PLAN", tests=values_text({"DY": top("D_PLAN")}, REFERENCE="ANALYTIQUE", VALE_REFE=top("D_PLAN")))
    write_case(cases, text, two_blocks("D_PLAN"))
    write_case(cases, text.replace("STAT_NON_LINE", "DYNA_NON_LINE"), "", "dynamic")
    result = gauntlet([cases], seconds=300.0, jobs=2)
    assert [(case.name, case.state) for case in result.cases] == [("case", WHOLE), ("dynamic", OTHER_KIND)]
    assert {case.program for case in result.cases} == {"code_aster"}
    lines = page(result, "signorini-fx gauntlet cases").splitlines()
    assert lines[0] == "# The gauntlet: code_aster"
    assert not any(line != line.rstrip() for line in lines)
    assert max(len(line) for line in lines if not line.startswith("|")) <= 120
    assert any(line.startswith("| case | displacement, DY at UP_CORNER | -0.03 | -0.03") for line in lines)
