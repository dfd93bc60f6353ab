"""Scenes of command files: what becomes of each command, and what is lost."""

import re

import numpy as np
import pytest
from command_cases import Mail, commands, top, two_blocks, write_case

from signorini_fx.addons.aster.draft import draft_commands
from signorini_fx.errors import MeshError, SignoriniError
from signorini_fx.scenes import cli
from signorini_fx.scenes.reading import read_scene
from signorini_fx.scenes.solver import solve


def drafted(folder, text, mail=None, model="D_PLAN"):
    """The draft of two blocks, or of another mesh."""
    return draft_commands(write_case(folder, text, mail or two_blocks(model)), folder / "out" / "scene.toml")


def scene_of(draft):
    """The scene, read again."""
    for file, text in draft.files.items():
        file.write_text(text)
    return read_scene(next(file for file in draft.files if file.suffix == ".toml"))


@pytest.mark.parametrize("model", ["D_PLAN", "C_PLAN", "AXIS", "3D"])
def test_two_blocks(tmp_path, model):
    """Nothing is lost; the slave has the contact points; each table names its command; loads follow their function."""
    draft = drafted(tmp_path, commands(model), model=model)
    assert (draft.lost, draft.noted) == ([], [])
    scene = scene_of(draft)
    hypothesis = {"C_PLAN": "plane stress", "AXIS": "axisymmetric"}.get(model, "plane strain")
    assert scene.statement.material[0].hypothesis == hypothesis
    (contact,) = scene.contact
    assert (contact.points, contact.gap) == ("boundary", 0.0)
    heights = draft.deck.mesh.points[draft.deck.mesh.facets[draft.deck.mesh.boundaries[contact.boundary]]][..., -1]
    assert np.all(heights == 1.0)
    up = "Z" if model == "3D" else "Y"
    traction = [entry for entry in scene.traction if entry.pressure]
    assert [entry.pressure for entry in traction] == [16.0]
    assert traction[0].factors == (1.0,) if len(draft.study.instants) == 1 else traction[0].factors == (0.5, 1.0)
    assert sum(getattr(entry, up.lower()) == 0.0 for entry in scene.displacement) == 1
    assert all(re.match(r"line \d+, (AFFE_CHAR_MECA|DEFI_CONTACT)$", origin) for origin in draft.origins.values())


@pytest.mark.parametrize(
    ("contact", "zone", "expected"),
    [
        ('FROTTEMENT="COULOMB", ', ", COULOMB=0.3", 'friction = { law = "coulomb", coefficient = 0.3 }'),
        ("", ', ALGO_CONT="PENALISATION", COEF_PENA_CONT=5.0e6', "gamma_n = 5000000.0"),
        (
            'FROTTEMENT="COULOMB", ',
            ', COULOMB=0.3, ALGO_CONT="PENALISATION", COEF_PENA_CONT=5.0e6, ALGO_FROT="PENALISATION", '
            "COEF_PENA_FROT=2.0e6",
            "gamma_t = 2000000.0",
        ),
        ("", ', ALGO_CONT="STANDARD", COEF_CONT=100.0', 'points = "boundary"'),
    ],
)
def test_contact(tmp_path, contact, zone, expected):
    """Friction and penalties; a coefficient of an augmented Lagrangian is no stiffness."""
    draft = drafted(tmp_path, commands("D_PLAN", contact, zone))
    assert draft.lost == []
    assert expected in draft.text
    assert ("gamma_n" in draft.text) == ("COEF_PENA_CONT" in zone)


def test_penalty_at_nodes(tmp_path):
    """E_N is a force per length at each node: over the mean area, of four nodes of a side of length 1."""
    text = commands("D_PLAN", zone=', ALGO_CONT="PENALISATION", E_N=3.0e5').replace('"CONTINUE"', '"DISCRETE"')
    draft = drafted(tmp_path, text)
    assert "gamma_n = 1200000.0" in draft.text
    assert draft.lost == []
    assert draft.noted == ["line 9, DEFI_CONTACT: zone 1: E_N at each node: over a mean area of 0.25 at a node"]


DDL = '_F(GROUP_NO=("LOW_CORNER", "UP_CORNER"), DDL=("DX", "DX"), COEF_MULT=(1.0, -1.0), COEF_IMPO={})'


@pytest.mark.parametrize(
    ("change", "lost"),
    [
        (('RELATION="ELAS"', 'RELATION="VMIS_ISOT_LINE"'), "RELATION='VMIS_ISOT_LINE': the material is elastic here"),
        (('RELATION="ELAS"', 'RELATION="ELAS", DEFORMATION="GDEF_LOG"'), "DEFORMATION='GDEF_LOG'"),
        (("PRES=8.0", "PRES=8.0, CISA_2D=1.0"), "CISA_2D"),
        (("PRES_REP=", 'ARETE_IMPO=_F(GROUP_MA="UP_y1"), PRES_REP='), "ARETE_IMPO is not known here"),
        (('ESCL="UP_y0"', 'ESCL="UP_y0", DIST_ESCL=RAMP'), "DIST_ESCL is not known here"),
        (('ESCL="UP_y0"', 'ESCL="UP_y0", ALGO_CONT="PENALISATION"'), "without its stiffness: contact is hard"),
        (("PRES_REP=", f"LIAISON_DDL={DDL.format(0.5)}, PRES_REP="), "COEF_IMPO other than 0"),
        (("EXCIT=(", "ETAT_INIT=_F(EVOL_NOLI=0), EXCIT=("), "ETAT_INIT"),
        (("FONC_MULT=RAMP", 'FONC_MULT=RAMP, TYPE_CHARGE="DIDI"'), "TYPE_CHARGE='DIDI'"),
        (("CHAM_MATER=FIELD", "PILOTAGE=_F(), CHAM_MATER=FIELD"), "PILOTAGE"),
        (('TOUT="OUI", MATER=MAT)', 'TOUT="OUI", MATER=MAT), AFFE_VARC=_F(NOM_VARC="TEMP")'), "AFFE_VARC: TEMP"),
    ],
)
def test_what_is_lost(tmp_path, change, lost):
    """What changes the answer is said, with the line of its command, and the scene says it itself."""
    text = commands("D_PLAN")
    assert change[0] in text
    draft = drafted(tmp_path, text.replace(*change))
    (remark,) = draft.lost
    assert lost in remark
    assert re.match(r"line \d+, [A-Z_]+: ", remark)
    assert scene_of(draft).incomplete == (remark,)


EXCLUDED = (
    'MESH = DEFI_GROUP(reuse=MESH, MAILLAGE=MESH, CREA_GROUP_NO=(_F(GROUP_MA="UP_x0"), _F(GROUP_MA="UP_x1"), '
    '_F(GROUP_MA="UP_y0"), _F(NOM="FREE", INTERSEC=("UP_x1", "UP_y0")), _F(NOM="HELD", INTERSEC=("UP_x0", "UP_y0"))))\n'
    "MODEL ="
)


@pytest.mark.parametrize("key", ["SANS_GROUP_NO", "SANS_GROUP_MA"])
@pytest.mark.parametrize("group", ["UP_x0", "FREE", "HELD"])
def test_nodes_without_contact(tmp_path, group, key):
    """They are apart in the scene: no pressure is there, but where supports hold them along the normal."""
    if key == "SANS_GROUP_MA" and group != "UP_x0":
        pytest.skip("only that one is a group of elements")
    text = commands("D_PLAN", zone=f', {key}="{group}"').replace("MODEL =", EXCLUDED, 1)
    if group == "HELD":
        text = text.replace("PRES_REP=", 'DDL_IMPO=_F(GROUP_NO="HELD", DY=0.0), PRES_REP=')
    draft = drafted(tmp_path, text)
    assert draft.lost == []
    reason = "which supports or relations hold" if group == "HELD" else "1 nodes, where contact or friction"
    assert [reason in remark for remark in draft.noted] == [True]
    scene = scene_of(draft)
    (contact,) = scene.contact
    assert (contact.gap == 0.0) == (group == "HELD")
    if group != "HELD":
        table = solve(scene).table.columns
        x, pressed = table["x"], table["pressure"] > 0
        there = np.isclose(x, x.min() if group == "UP_x0" else x.max())
        assert there.sum() == 1
        np.testing.assert_array_equal(pressed, ~there)


@pytest.mark.parametrize("model", ["D_PLAN", "3D"])
def test_nodes_between_elements_of_opposite_orders(tmp_path, model):
    """A surface in whose file not all elements have their nodes in the same order has normals all the same."""
    up = "z" if model == "3D" else "y"
    inner = """DEFI_GROUP(reuse=MESH, MAILLAGE=MESH, CREA_GROUP_NO=_F(
    NOM="INNER", OPTION="PLAN", POINT=(0.5, 0.0, 0.0), VECT_NORMALE=(1.0, 0.0, 0.0), PRECISION=0.01))
MODEL ="""
    text = commands(model, zone=', SANS_GROUP_NO="INNER"').replace("MODEL =", inner, 1)
    mail = two_blocks(model, columns=(2, 2))
    draft = drafted(tmp_path, text, mail)
    named = re.search(rf"GROUP_MA\nUP_{up}0\n(M\d+)", mail)[1]
    lines = mail.splitlines()
    row = next(k for k, line in enumerate(lines) if line.startswith(f"{named} "))
    name, *nodes = lines[row].split()
    lines[row] = " ".join([name, *reversed(nodes)])
    (folder := tmp_path / "reversed").mkdir()
    other = drafted(folder, text, "\n".join(lines) + "\n")
    count = 1 if model == "D_PLAN" else 3
    remark = f"SANS_GROUP_NO: {count} nodes, where contact or friction has an exception"
    assert [remark in noted for noted in draft.noted + other.noted] == [True, True]
    assert scene_of(other).contact[0].gap == scene_of(draft).contact[0].gap != 0.0


def test_nodes_without_friction(tmp_path):
    """They have contact, but no shear; along a direction that supports hold friction has nothing to do."""
    zone = ', COULOMB=0.3, SANS_GROUP_NO_FR="FREE"'
    text = commands("D_PLAN", 'FROTTEMENT="COULOMB", ', zone).replace("MODEL =", EXCLUDED, 1)
    push = text.replace('_F(GROUP_MA="UP_x0", DX=0.0)', '_F(GROUP_MA="UP_x0", DX=0.01)')
    draft = drafted(tmp_path, push)
    assert draft.lost == []
    table = solve(scene_of(draft)).table.columns
    there = np.isclose(table["x"], table["x"].max())
    assert (table["pressure"] > 0).all()
    assert there.sum() == 1
    np.testing.assert_array_equal(np.abs(table["shear"]) > 1e-3, ~there)
    for name, group, direction, lost in (("along", "FREE", 1, 1), ("up", "FREE", 0, 1), ("held", "HELD", 1, 0)):
        exception = f", DIRE_EXCL_FROT=({direction}.0, {1.0 - direction}, 0.0)"
        (folder := tmp_path / name).mkdir()
        other = text.replace('_FR="FREE"', f'_FR="{group}"{exception}')
        assert len(drafted(folder, other).lost) == lost


@pytest.mark.parametrize("degree", [1, 2])
def test_values_at_nodes_of_faces_without_a_middle(tmp_path, degree):
    """The node in the middle, which cells of 20 nodes get here, moves as the element of the file has it: under a
    prescribed uniform strain by that strain.
    """
    text = commands("3D").replace("MODEL =", 'PULL = FORMULE(VALE="0.01 * X", NOM_PARA=["X", "Y", "Z"])\nMODEL =', 1)
    text = text.replace('_F(GROUP_MA="UP_x0", DX=0.0)', '_F(GROUP_MA="UP", DX=PULL)').replace(
        "AFFE_CHAR_MECA(", "AFFE_CHAR_MECA_F("
    )
    draft = drafted(tmp_path, text, two_blocks("3D", degree, columns=(1, 1)))
    assert draft.lost == []
    middles = {node for link in draft.deck.links for node, _ in link.terms if node >= len(draft.deck.names)}
    assert (len(middles) == 0) == (degree == 1)
    if degree == 2:
        solution = solve(scene_of(draft))
        assert solution.converged
        x = solution.displacement.function_space.tabulate_dof_coordinates()
        u = solution.displacement.x.array.reshape(-1, 3)
        top_face = np.isclose(x[:, 2], 2.0)
        assert top_face.sum() == 9
        np.testing.assert_allclose(u[top_face, 0], 0.01 * x[top_face, 0], atol=1e-6)


@pytest.mark.parametrize("direction", ["(0.0, 0.0, 0.0)", "(1.0,)"])
def test_a_direction_that_is_none(tmp_path, direction):
    """It does not count as one that supports hold."""
    zone = f', COULOMB=0.3, SANS_GROUP_NO_FR="FREE", DIRE_EXCL_FROT={direction}'
    text = commands("D_PLAN", 'FROTTEMENT="COULOMB", ', zone).replace("MODEL =", EXCLUDED, 1)
    with pytest.raises(MeshError, match="DIRE_EXCL_FROT: 2 numbers that are not all 0 are expected"):
        drafted(tmp_path, text)


@pytest.mark.parametrize("word", ['BLOCAGE="deplacement"', 'LIAISON="encastre"', 'LIAISON="PERIODIQUE"'])
def test_supports_that_are_not_known_are_lost(tmp_path, word):
    """Words are as code_aster has them."""
    text = commands("D_PLAN").replace('GROUP_MA="LOW_x0", DX=0.0', f'GROUP_MA="LOW_x0", {word}')
    (lost,) = drafted(tmp_path, text).lost
    key, _, value = word.partition("=")
    assert lost == f"line 7, AFFE_CHAR_MECA: {key}={value.replace(chr(34), chr(39))} is not known here"
    (folder := tmp_path / "held").mkdir()
    held = drafted(folder, commands("D_PLAN").replace('"LOW_x0", DX=0.0', '"LOW_x0", LIAISON="ENCASTRE"'))
    assert held.lost == []


@pytest.mark.parametrize(
    ("key", "written", "lost"),
    [
        ("    CONTACT=", "    contact=", "line 16, STAT_NON_LINE: contact is not known: keywords are in capitals"),
        ("    CONTACT=CONT,\n", "", "line 9, DEFI_CONTACT: nothing that is solved has it as its CONTACT"),
        ("FONC_MULT=", "FONC_MUL=", "line 16, STAT_NON_LINE: EXCIT: FONC_MUL is not known here"),
        ("    MODELE=MODEL,\n    FORM", "    MODELE=MODEL, x=1,\n    FORM", "line 9, DEFI_CONTACT: x is not known: "),
        ("GROUP_MA_MAIT=", "coulomb=1.0, GROUP_MA_MAIT=", "line 9, DEFI_CONTACT: coulomb is not known: "),
    ],
)
def test_keywords_that_are_misspelled_are_lost(tmp_path, key, written, lost):
    """Contact, or the course of a load, is not left out in silence."""
    text = commands("D_PLAN")
    assert text.count(key) == 1
    assert any(remark.startswith(lost) for remark in drafted(tmp_path, text.replace(key, written)).lost)


def test_contact_that_does_not_open_again(tmp_path):
    """Whether it would is seen in the solution: the draft lacks nothing."""
    draft = drafted(tmp_path, commands("D_PLAN", zone=', GLISSIERE="OUI"'))
    assert draft.lost == []
    assert draft.study.stays == ["line 9, DEFI_CONTACT: zone 1: GLISSIERE"]


PULL = """
def step(x):
    if x < {0}:
        return 4.0
    return 12.0

PRESSURE = FORMULE(VALE="step({1})", step=step, NOM_PARA=["X", "Y"])
MODEL ="""


@pytest.mark.parametrize(("edge", "lost"), [(0.5, False), (0.6, True)])
def test_a_pressure_that_is_a_function_of_the_position(tmp_path, edge, lost):
    """One that is constant on each element of the boundary is several; another one is lost."""
    text = commands("D_PLAN").replace("MODEL =", PULL.format(edge, "X").lstrip("\n"), 1)
    text = text.replace("AFFE_CHAR_MECA(", "AFFE_CHAR_MECA_F(").replace("PRES=8.0", "PRES=PRESSURE")
    mail = Mail(2, 1)
    mail.block("UP", [2, 1], [0.0, 1.0], [1.0, 2.0])
    mail.block("LOW", [2, 1], [0.0, 0.0], [1.0, 1.0])
    draft = drafted(tmp_path, text, mail.text)
    assert [remark.endswith("PRES: a function of the position within an element") for remark in draft.lost] == [
        True
    ] * lost
    if not lost:
        pressed = {entry.pressure: entry.boundary for entry in scene_of(draft).traction}
        assert sorted(pressed) == [8.0, 24.0]  # times the largest value of the function of the instant
        for value, boundary in pressed.items():
            facets = draft.deck.mesh.facets[draft.deck.mesh.boundaries[boundary]]
            middle = draft.deck.mesh.points[facets].mean(axis=1)
            np.testing.assert_allclose(middle, [[0.25 if value == 8.0 else 0.75, 2.0]])


def test_a_surface_without_body(tmp_path):
    """It is rigid where supports hold all of its nodes: the distance to it becomes the gap."""
    mail = Mail(2, 1)
    mail.block("UP", [3, 1], [0.0, 1.5], [1.0, 2.5])
    mail.block("LOW", [1, 1], [-1.0, 0.0], [2.0, 1.0])
    text = commands("D_PLAN").replace('TOUT="OUI", PHENOMENE', 'GROUP_MA=("UP",), PHENOMENE', 1)
    text = text.replace('_F(GROUP_MA="LOW_y0", DY=0.0)', '_F(GROUP_MA="LOW_y1", DX=0.0, DY=0.0)')
    draft = drafted(tmp_path, text, mail.text)
    assert draft.lost == []
    (contact,) = scene_of(draft).contact
    assert "against" not in draft.text
    assert contact.direction == (0.0, -1.0)
    assert 'gap = "-1.0 + x[1]"' in draft.text
    loose = text.replace("DX=0.0, DY=0.0)", "DX=0.0)")
    other = tmp_path / "other"
    other.mkdir()
    assert "a surface without body that is not held" in drafted(other, loose, mail.text).lost[0]


@pytest.mark.parametrize(
    ("change", "why"),
    [
        (('FORMAT="ASTER"', 'FORMAT="IDEAS"'), r"line 3, LIRE_MAILLAGE: FORMAT='IDEAS'"),
        (('MODELISATION="D_PLAN"', 'MODELISATION="DKT"'), r"line 4, AFFE_MODELE: MODELISATION='DKT'"),
        (('GROUP_MA="UP_y1"', 'GROUP_MA="UP_TOP"'), r"line 8, AFFE_CHAR_MECA: there is no GROUP_MA 'UP_TOP'"),
        (('ESCL="UP_y0"', 'ESCL="UP"'), r"line 9, DEFI_CONTACT: zone 1: GROUP_MA_ESCL: elements of a boundary"),
        (("E=1000.0", "E=many"), r"line 5, DEFI_MATERIAU: E: 'many' is not defined"),
        (("NU=0.25", "NU='0.25'"), r"line 5, DEFI_MATERIAU: NU: a number is expected, not '0\.25'"),
        (("PRES=8.0", "PRES=MAT"), r"MAT.*|line 5, DEFI_MATERIAU: this is no function"),
        (("MODELE=MODEL,\n    CHAM", "CHAM"), r"line 16, STAT_NON_LINE: MODELE: the result of a command is expected"),
        (("INCREMENT=", "INCREASE="), r"line 16, STAT_NON_LINE: INCREMENT: _F\(...\) is expected"),
        (("NOMBRE=2", "NOMBRE=0"), r"line 15, DEFI_LIST_REEL: INTERVALLE: 0 steps"),
        (("RES = STAT_NON_LINE", "RES = CALC_MODES"), r"it solves nothing"),
        (('TOUT="OUI", MATER', 'GROUP_MA="UP", MATER'), r"cells of the body have no material"),
        (("ELAS=_F(E=1000.0, NU=0.25)", "ELAS=()"), r"line 5, DEFI_MATERIAU: ELAS: _F\(...\) is expected"),
        (('MODELISATION="D_PLAN"', "MODELISATION=()"), r"line 4, AFFE_MODELE: MODELISATION: a text is expected"),
        (("ZONE=", "zone="), r"line 9, DEFI_CONTACT: ZONE: _F\(...\) is expected"),
        (("ZONE=", 'FROTTEMENT="coulomb", ZONE='), r"FROTTEMENT='coulomb': known are SANS, COULOMB"),
        (('"UP_y0")', '"UP_y0", GLISSIERE="oui")'), r"DEFI_CONTACT: GLISSIERE='oui': known are NON, OUI"),
        (('"UP_y0")', '"UP_y0", RESOLUTION="non")'), r"DEFI_CONTACT: RESOLUTION='non': known are OUI, NON"),
        (('"UP_y0")', '"UP_y0", ALGO_CONT="penalisation")'), r"ALGO_CONT='penalisation': known are STANDARD"),
        (('"UP_y0")', '"UP_y0", GLISSIERE=WHAT)'), r"DEFI_CONTACT: GLISSIERE: 'WHAT' is not defined"),
        (('"UP_y0")', '"UP_y0", SANS_GROUP_NO=())'), r"DEFI_CONTACT: SANS_GROUP_NO: a text is expected"),
        (("INTERVALLE=_F(JUSQU_A=2.0, NOMBRE=2)", "INTERVALLE=_F(JUSQU_A=-2.0, NOMBRE=2)"), r"instants must increase"),
        (
            ("PRES_REP=", "PESANTEUR=_F(GRAVITE=1.0, DIRECTION=(0.0, 0.0, 0.0)), PRES_REP="),
            r"line 8, AFFE_CHAR_MECA: PESANTEUR: DIRECTION: three numbers that are not all 0",
        ),
        (("2.0, 2.0))", "1.0, 1.0))"), r"line 14, DEFI_FONCTION: it has no value at 2"),
    ],
)
def test_errors_name_the_command(tmp_path, change, why):
    """One line that says where."""
    text = commands("D_PLAN")
    assert change[0] in text
    with pytest.raises(MeshError, match=why) as raised:
        drafted(tmp_path, text.replace(change[0], change[1], 1))
    assert str(raised.value).startswith(str(tmp_path / "case.comm"))
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize("share", np.linspace(0.02, 0.98, 13))
@pytest.mark.parametrize("which", ["comm", "mail"])
def test_mutilated_files(tmp_path, which, share):
    """Files that end too early: one error, or what is left of the problem with what it lacks."""
    texts = {"comm": commands("D_PLAN"), "mail": two_blocks("D_PLAN")}
    texts[which] = texts[which][: int(share * len(texts[which]))]
    said = []
    try:
        assert drafted(tmp_path, texts["comm"], texts["mail"]).text
    except SignoriniError as error:
        said.append(str(error))
    assert all(line.startswith(str(tmp_path / "case")) and "\n" not in line for line in said)


@pytest.mark.parametrize(
    ("change", "why"),
    [
        (("COOR_2D", "COOR_4D"), "COOR_4D is not known"),
        (("QUAD4", "QUAD5"), "QUAD5 is not known"),
        (("FINSF\nGROUP_MA\nLOW\n", "FINSF\nGROUP_MA\nLOW\nM999\n"), "GROUP_MA LOW: there is no element M999"),
        (("FINSF\nGROUP_NO\nLOW_CORNER\n", "FINSF\nGROUP_NO\nLOW_CORNER\nN999\n"), "there is no node N999"),
        (("M1 N1 ", "M1 N999 "), "QUAD4: there is no node 'N999'"),
        (("N1 0 0", "N1 0 zero"), "COOR_2D: could not convert"),
    ],
)
def test_mesh_files_that_are_wrong(tmp_path, change, why):
    """The line of the section, and what is wrong."""
    mail = two_blocks("D_PLAN")
    assert change[0] in mail
    with pytest.raises(MeshError, match=rf"case\.mail.*{why}"):
        drafted(tmp_path, commands("D_PLAN"), mail.replace(change[0], change[1], 1))


def test_run(tmp_path, monkeypatch, capsys):
    """`run` drafts, solves and writes; `convert` writes the scene alone; both say what is lost."""
    monkeypatch.chdir(tmp_path)
    write_case(tmp_path, commands("D_PLAN"), two_blocks("D_PLAN"))
    assert cli.main(["run", "case.comm", "--no-pictures"]) == 0
    said = capsys.readouterr().out
    assert "case.frd" in said
    fields = (tmp_path / "results" / "case" / "case.frd").read_text().split("DISP")[-1].partition(" -3")[0]
    heights = [float(line[25:37]) for line in fields.splitlines() if line.startswith(" -1")]
    assert min(heights) == pytest.approx(top("D_PLAN"), rel=1e-4)
    # What the solution says itself: surfaces slide by 2 % of their length, and contact follows them there.
    sliding = tmp_path / "sliding.comm"
    slide = commands("D_PLAN").replace('_F(GROUP_MA="UP_x0", DX=0.0)', '_F(GROUP_MA="UP_x0", DX=0.02)')
    sliding.write_text(slide)
    sliding.with_suffix(".mail").write_text(two_blocks("D_PLAN"))
    assert cli.main(["run", "sliding.comm", "--no-pictures"]) == 4
    said = capsys.readouterr()
    assert (
        "changes the answer: line 9, DEFI_CONTACT: REAC_GEOM: contact does not follow surfaces that slide" in said.out
    )
    assert "1 thing that changes the answer" in said.err
    lost = tmp_path / "lost.comm"
    lost.write_text(commands("D_PLAN").replace('ELAS")', 'ELAS", DEFORMATION="GDEF_LOG")'))
    lost.with_suffix(".mail").write_text(two_blocks("D_PLAN"))
    assert cli.main(["convert", "lost.comm", "scene.toml"]) == 4
    assert "lost: line 16, STAT_NON_LINE: DEFORMATION='GDEF_LOG'" in capsys.readouterr().out
    assert (tmp_path / "scene.inp").is_file()
    assert cli.main(["convert", "lost.comm", "mesh.vtu"]) == 2
    assert "a command file becomes a scene" in capsys.readouterr().err
