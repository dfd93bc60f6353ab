"""Files of Kratos and FrontISTR: what is read of them, and one clear error with its line for those that are wrong."""

import json
import random
import re

import numpy as np
import pytest
from block_cases import FrontistrCase, KratosCase, process

from signorini_fx.addons.aster.draft import draft_study
from signorini_fx.addons.cases.frontistr import read_frontistr
from signorini_fx.addons.cases.hecmw import read_cards, read_result
from signorini_fx.addons.cases.kratos import read_kratos, times_of
from signorini_fx.addons.cases.located_json import read_object
from signorini_fx.addons.cases.mdpa import read_mdpa
from signorini_fx.errors import MeshError
from signorini_fx.mechanics.mesh.files.cells import CELLS


def kratos_study(folder, case):
    return read_kratos(case.write(folder))


def test_json_knows_its_lines(tmp_path):
    """Objects know where they begin, comments are none of the content, and numbers and strings are those of json."""
    file = tmp_path / "a.json"
    file.write_text('{ // first\n "a": [1.5e3, true, null, "x\\u00e9"], /* two\nlines */ "b": {\n"c": {} }}\n')
    content = read_object(file)
    assert content == {"a": [1500.0, True, None, "xé"], "b": {"c": {}}}
    assert (content.line, content["b"].line, content["b"]["c"].line) == (1, 3, 4)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('{"a": 1,\n"b" 2}', "line 2: a colon is expected, not '2}'"),
        ('{"a": 1\n"b": 2}', "line 2: a comma or the end of an object is expected"),
        ('{"a": [1\n2]}', "line 2: a comma or the end of a list is expected"),
        ('{"a":\n', "line 2: the file ends where a value is expected"),
        ('{"a": 1,\n', "line 2: the file ends where a name in quotation marks is expected"),
        ('{"a": 1,\n"a": 2}', "line 2: a is there twice"),
        ('{"a": 1}\n{', "line 2: there is more after its end"),
        ("[1]", "line 1: an object in braces is expected"),
        ('{"a":\nNaN}', "line 2: NaN is no number"),
        ('{"a":\n"x}', "line 2: unterminated string"),
        ('{"a": ' + "[" * 5000, "line 1: nested too deeply"),
    ],
)
def test_json_that_is_wrong(tmp_path, text, message):
    """Each with its line."""
    file = tmp_path / "a.json"
    file.write_text(text)
    with pytest.raises(MeshError, match=re.escape(f"{file}: {message}")):
        read_object(file)


def test_a_model_part(tmp_path):
    """Nodes in the order of their numbers, blocks, parts within parts, properties, and what is not read."""
    file = tmp_path / "a.mdpa"
    file.write_text("""Begin Properties 3
 YOUNG_MODULUS 2.5e3 // a comment
 Begin Table 1 TIME DISPLACEMENT
  0.0 1.0
 End Table
 BODY_FORCE [3] (0,0,0)
End Properties
Begin Nodes
 7 1.0 0.0 0.0
 2 0.0 0.0 0.0
 5 0.0 1.0 0.0
End Nodes
Begin Elements SmallDisplacementElement2D3N
 4 3 2 7 5
End Elements
Begin NodalData PRESSURE
 2 0 1.0
End NodalData
Begin SubModelPart Outer
 Begin SubModelPartNodes
  2 7
 End SubModelPartNodes
 Begin SubModelPart Inner
  Begin SubModelPartElements
   4
  End SubModelPartElements
 End SubModelPart
End SubModelPart
""")
    model = read_mdpa(file)
    assert model.numbers.tolist() == [2, 5, 7]
    assert model.points.tolist() == [[0, 0, 0], [0, 1, 0], [1, 0, 0]]
    assert model.rows(np.array([7, 2])).tolist() == [2, 0]
    (block,) = model.elements
    assert (block.name, block.line, block.dim, block.nodes.tolist()) == (
        "SmallDisplacementElement2D3N",
        13,
        2,
        [[2, 7, 5]],
    )
    assert (model.parts["Outer"].nodes, model.parts["Outer.Inner"].elements) == ([2, 7], [4])
    assert model.properties == {3: {"YOUNG_MODULUS": 2500.0}}
    assert model.unread == {3: "Table 1 TIME DISPLACEMENT", 16: "NodalData PRESSURE"}


@pytest.mark.parametrize(
    ("before", "after", "message"),
    [
        ("End Nodes", "", r"line \d+: End Nodes is expected, as it began on line 6"),
        ("Begin Nodes // all", "Begin Nodes // all\n 1 2 3", r"line 7: a number and three coordinates are expected"),
        ("Begin Nodes // all", "Begin Nodes // all\n 10 0 0 0", r"line 8: node 10 is there again: it was on line 7"),
        ("Begin Nodes // all", "Begin Nodes // all\n 1.5 0 0 0", r"line 7: the number of a node is expected"),
        ("Begin SubModelPart Up", "Begin SubModelPart", r"line \d+: Begin SubModelPart: a name is expected"),
        ("Begin Elements Small", "Begin Elements\nSmall", r"line \d+: Begin Elements: the name of their class"),
        ("Begin Elements Small", "Begin Elements Shell", r"line \d+: ShellDisplacementElement2D4N is not known here|"),
        (" 1 0 10 ", " 1 0 ", r"line \d+: SmallDisplacementElement2D4N: a number, properties and 4 nodes are expected"),
        (" 1 0 10 ", " 1 0 999 ", r"line \d+: SmallDisplacementElement2D4N: element 1 has node 999"),
        (" 2 0 ", " 1 0 ", r"line \d+: element 1 is there twice"),
        ("Begin SubModelPart Low", "Begin SubModelPart Low\nBegin SubModelPartNodes\n999\nEnd SubModelPartNodes",
         r"line \d+: SubModelPart Low: node 999 is not there"),
        ("Begin ModelPartData", "Nothing", r"line 1: Begin and a name are expected, not 'Nothing'"),
    ],
)  # fmt: skip
def test_a_model_part_that_is_wrong(tmp_path, before, after, message):
    """Each with its line."""
    file = KratosCase().write(tmp_path)
    model = file.with_name("case.mdpa")
    text = model.read_text()
    assert before in text
    model.write_text(text.replace(before, after, 1))
    if "Shell" in after:
        read_kratos(file)  # the class is known by its end
        return
    with pytest.raises(MeshError, match=message) as caught:
        read_kratos(file)
    assert str(caught.value).startswith(f"{model}: ")


def _set(*keys):
    """Change a value of the parameters: the last one of the keys is the new value."""

    def change(case):
        entry = case.parameters
        for key in keys[:-2]:
            entry = entry[key]
        entry[keys[-2]] = keys[-1]

    return change


def _material(*keys):
    def change(case):
        entry = case.materials[0]
        for key in keys[:-2]:
            entry = entry[key]
        entry[keys[-2]] = keys[-1]

    return change


HELD = ("processes", "constraints", 0, "Parameters")
LOADED = ("processes", "loads", 0, "Parameters")
TOUCHING = ("processes", "contact", 0, "Parameters")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (_set("solver_settings", "model_import_settings", "input_filename", "no"), "no.mdpa is not there"),
        (_set("solver_settings", "time_stepping", {}), "time_stepping: no step is given at the time 0"),
        (_set("solver_settings", "time_stepping", "time_step", 0.0), "time_step: a number above 0 is expected"),
        (_set("solver_settings", "time_stepping", "time_step", "a"), "time_step: a number is expected, not 'a'"),
        (_set("problem_data", "end_time", -1.0), "end_time: -1 is not after start_time, 0"),
        (_set("problem_data", "end_time", 1e9), "time_step: more than 40000 steps to 1e+09"),
        (_set("processes", "constraints", 3), "constraints: a list of objects is expected, not 3"),
        (_set(*HELD, "model_part_name", "Structure.None"), "model_part_name: case.mdpa has no SubModelPart None"),
        (_set(*HELD, "value", [0.0]), "value: three numbers or functions are expected"),
        (_set(*HELD, "value", [0.0, "t +", 0.0]), "syntax error"),
        (_set(*HELD, "value", [0.0, "__import__('os')", 0.0]), "__import__"),
        (_set(*HELD, "value", [0.0, "1/(t-t)", 0.0]), "'1/(t-t)' is not finite at the time 0.5"),
        (_set(*HELD, "constrained", 3), "constrained: true, false, or three of them are expected"),
        (_set(*HELD, "interval", [0.0]), "interval: two numbers, or a number and 'End', are expected"),
        (_set(*LOADED, "direction", [0.0, 0.0, 0.0]), "direction: it has no length"),
        (_set(*LOADED, "direction", [1.0]), "direction: three numbers are expected"),
        (_set(*LOADED, "modulus", "x * t"), "a load that depends on the place is not known here"),
        (_set(*LOADED, "modulus", []), "a number or a function is expected, not []"),
        (_set(*TOUCHING, "contact_model_part", {}), "no contact is known here"),
        (_material("Material", "constitutive_law", "name", "SmallStrainJ2Plasticity"), "Plasticity is not known"),
        (_material("Material", "constitutive_law", "name", "LinearElastic3DLaw"), "one plane law is expected"),
        (_material("Material", "Variables", "YOUNG_MODULUS", None), "YOUNG_MODULUS: a number is expected, not nothing"),
        (_material("model_part_name", "Structure.Up"), "some elements have no material"),
    ],
)  # fmt: skip
def test_parameters_that_are_wrong(tmp_path, change, message):
    """Each with its line and the name of the value."""
    case = KratosCase()
    change(case)
    with pytest.raises(MeshError, match=re.escape(message)) as caught:
        kratos_study(tmp_path, case)
    assert re.search(r"\.json: line \d+: ", str(caught.value))


@pytest.mark.parametrize("constrained", [True, False])
def test_a_component_that_is_not_constrained(tmp_path, constrained):
    """What is a value to begin with and holds nothing is no support."""
    case = KratosCase()
    held = case.parameters["processes"]["constraints"][0]["Parameters"]
    name = held["model_part_name"]
    case.parameters["processes"]["constraints"].append(
        {
            "python_module": "assign_scalar_variable_process",
            "Parameters": {
                "model_part_name": name,
                "variable_name": "DISPLACEMENT_X",
                "value": 0.125,
                "constrained": constrained,
            },
        }
    )
    values = {value for support in kratos_study(tmp_path, case).supports for value in support.values}
    assert (0.125 in values) == constrained


def test_friction_of_a_pair_and_of_materials(tmp_path):
    """The coefficient of the pair counts, else that of the materials of the slave side; all steps are solved then."""
    case = KratosCase()
    case.parameters["processes"]["contact"][0]["Parameters"]["contact_type"] = "Frictional"
    for number, entry in enumerate(case.materials):
        entry["Material"]["Variables"]["FRICTION_COEFFICIENT"] = 0.25 + number
    study = kratos_study(tmp_path, case)
    assert [zone.coefficient for zone in study.zones] == [1.25]
    assert study.instants == [0.25, 0.5, 0.75, 1.0]
    case.parameters["processes"]["contact"][0]["Parameters"]["friction_coefficients"] = {"0": 0.5}
    assert [zone.coefficient for zone in kratos_study(tmp_path, case).zones] == [0.5]


def test_sides_without_an_assumption(tmp_path):
    """The first body that touches has the slave side; conditions of parts say which sides are meant."""
    case = KratosCase()
    del case.parameters["processes"]["contact"][0]["Parameters"]["assume_master_slave"]
    study = kratos_study(tmp_path, case)
    (zone,) = study.zones
    heights = [study.mesh.points[study.mesh.nodes_of_cells(marks)][:, 1] for marks in (zone.slave, zone.master)]
    assert [len(part) for part in heights] == [3, 4]
    assert all((part == 1.0).all() for part in heights)
    nodes = case.blocks.sides[1, 1, 0]
    case.conditions += nodes
    first = len(case.conditions) - len(nodes) + 1
    case.parts["Contact"] = (case.blocks.nodes((0, 1, 1), (1, 1, 0)), (), range(first, first + 2))
    case.parts["Other"] = (case.blocks.nodes((0, 1, 1)), (), ())
    case.parameters["processes"]["contact"][0]["Parameters"]["contact_model_part"] = {"0": ["Contact", "Other"]}
    case.parameters["processes"]["contact"][0]["Parameters"]["assume_master_slave"] = {"0": ["Up"]}
    (zone,) = kratos_study(tmp_path, case).zones
    assert [sum(int(mark.sum()) for mark in side) for side in (zone.slave, zone.master)] == [2, 2]  # two of three sides


def test_steps_in_intervals_and_functions_of_the_place(tmp_path):
    """Steps change where an interval ends; a displacement may be a function of the place."""
    case = KratosCase()
    case.parameters["solver_settings"]["time_stepping"] = {
        "time_step_intervals": {
            "first": {"interval": [0.0, 0.5], "time_step": 0.5},
            "second": {"interval": [0.5, "End"], "time_step": 0.25},
        }
    }
    case.parameters["problem_data"]["end_time"] = 1.2
    case.results = {"TIME": [0.5, 1.0]}
    held = case.parameters["processes"]["constraints"][0]["Parameters"]
    held["value"] = [0.0, "0.5*x*t^2 + y", 0.0]
    study = kratos_study(tmp_path, case)
    assert study.instants == [0.5, 1.0]
    (support,) = [support for support in study.supports if support.component == 1]
    x = study.mesh.points[support.nodes]
    assert np.allclose(support.values[1], 0.5 * x[:, 0] + x[:, 1], rtol=1e-14)
    assert np.allclose(support.values[0], 0.125 * x[:, 0] + x[:, 1], rtol=1e-14)


def test_times_of_values(tmp_path):
    """They are numbers; a file may have none."""
    file = tmp_path / "a.json"
    file.write_text('{"TIME": [1, 2.5]}')
    assert times_of(file) == [1.0, 2.5]
    file.write_text("{}")
    assert times_of(file) == []
    file.write_text('{"TIME": ["a"]}')
    with pytest.raises(MeshError, match="line 1: TIME: a list of numbers is expected"):
        times_of(file)


def test_cards(tmp_path):
    """Keywords with parameters, data at commas and blanks, comments, and what stands after the end."""
    file = tmp_path / "a.cnt"
    file.write_text("# a\n!BOUNDARY , GRPID = 3, TOTAL\n A, 1 , 1,\n!! b\n\n 2 3\n!END\n!CLOAD\n")
    (card,) = read_cards(file)
    assert (card.keyword, card.line, card.parameters) == ("BOUNDARY", 2, {"GRPID": "3", "TOTAL": ""})
    assert card.rows == [(3, ["A", "1", "1", ""]), (6, ["2", "3"])]
    assert card.whole_parameter("GRPID", 1) == 3


@pytest.mark.parametrize(
    ("file", "before", "after", "message"),
    [
        ("msh", "!NODE\n", "!NODE\n 1, 2, 3\n", r"line 4: !NODE: a number and three coordinates are expected"),
        ("msh", "!NODE\n", "!NODE\n 10, 0, 0, 0\n", r"!NODE: node 10 is there twice"),
        ("msh", "!NODE\n", "!NODE\n 1, 0, 0, abc\n", r"line 4: !NODE: a number is expected, not 'abc'"),
        ("msh", "TYPE=361", "TYPE=611", r"!ELEMENT: TYPE=611 is not known here"),
        ("msh", " 1, 10,", " 1, 999,", r"!ELEMENT: node 999 of element 1 is not there"),
        ("msh", " 1, 10,", " 1,", r"!ELEMENT: a number and 8 nodes for each element are expected"),
        ("msh", "!SGROUP, SGRP=TOP\n", "!SGROUP, SGRP=TOP\n 1, 7\n", r"!DLOAD: TOP: element 1 has no face 7"),
        ("msh", "EGRP=LOW, MATERIAL", "EGRP=NO, MATERIAL", r"there is no EGRP 'NO'"),
        ("msh", "!SECTION, TYPE=SOLID, EGRP=LOW, MATERIAL=STEEL\n 1.0\n", "", r"case.msh are in no !SECTION"),
        ("msh", "SGRP=LOWER\n", "SGRP=OTHER\n", r"there is no SGRP 'LOWER'"),
        ("msh", "!NGROUP, NGRP=BOTTOM\n", "!NGROUP, NGRP=BOTTOM\n 999\n", r"!NGROUP: NGRP 999 is not there"),
        ("msh", "!NGROUP, NGRP=BOTTOM\n", "!NGROUP, NGRP=BOTTOM, GENERATE\n 1, 9, 0\n", r"first, last and step are"),
        ("msh", "!NGROUP, NGRP=BOTTOM\n", "!NGROUP\n", r"!NGROUP: NGRP is expected"),
        ("cnt", "NLSTATIC", "HEAT", r"line 3: !SOLUTION: TYPE=HEAT: only static steps are taken"),
        ("cnt", " WALL_X, 1, 1", " WALL_X, 1", r"line 7: !BOUNDARY: a group, and the first and the last component"),
        ("cnt", " WALL_X, 1, 1", " WALL_X, 1, 6", r"line 7: !BOUNDARY: components are 1 to 3"),
        ("cnt", " WALL_X, 1, 1", " WALL_Z, 1, 1", r"line 7: there is no NGRP 'WALL_Z'"),
        ("cnt", "!BOUNDARY, GRPID=1", "!BOUNDARY, GRPID=a", r"line 5: !BOUNDARY, GRPID: a whole number is expected"),
        ("cnt", "!BOUNDARY, GRPID=1", "!BOUNDARY, AMP=A", r"line 5: !BOUNDARY: AMP and ROT_CENTER are not known here"),
        ("cnt", "TOP, S,", "TOP, Q,", r"line 10: !DLOAD: 'Q' is not known here"),
        ("cnt", " PAIR, 0.0", " OTHER, 0.0", r"line 13: !CONTACT: there is no !CONTACT PAIR 'OTHER'"),
        ("cnt", "!ELASTIC, INFINITESIMAL", "!HYPERELASTIC", r"!HYPERELASTIC: only elastic materials are known here"),
        ("cnt", "!STEP, SUBSTEPS=2", "!STEP, SUBSTEPS=0", r"!STEP: SUBSTEPS=0"),
        ("cnt", "!STEP, SUBSTEPS=2", "!STEP, SUBSTEPS=2\n HEAT, 1", r"line 18: !STEP: a number is expected"),
        ("cnt", " LOAD, 1", " HEAT, 1", r"line 19: !STEP: 'HEAT' is not known here"),
        ("cnt", "!STEP, SUBSTEPS=2", "!WRITE", r"line 1: !STEP is expected"),
        ("cnt", " WALL_X, 1, 1", " 999999, 1, 1", r"line 7: !BOUNDARY: node 999999 is not there"),
        ("cnt", " WALL_X, 1, 1", " 0, 1, 1", r"line 7: !BOUNDARY: node 0 is not there"),
        ("cnt", "!SOLVER", "!CLOAD\n 0, 1, 5.0\n!SOLVER", r"!CLOAD: node 0 is not there"),
        ("cnt", "!SOLVER", "!CLOAD\n 999999, 1, 5.0\n!SOLVER", r"!CLOAD: node 999999 is not there"),
        ("msh", ", LOWER\n", ", LOWER\n UPPER, LOWER\n", r"!CONTACT PAIR: one line with two groups is expected"),
        ("cnt", "!CONTACT, INT", "!CONTAKT, INT", r"line 1: no contact is known here"),
    ],
)  # fmt: skip
def test_cards_that_are_wrong(tmp_path, file, before, after, message):
    """Each with its line."""
    control = FrontistrCase().write(tmp_path)
    changed = control.with_suffix(f".{file}")
    text = changed.read_text()
    assert before in text
    changed.write_text(text.replace(before, after, 1))
    with pytest.raises(MeshError, match=message) as caught:
        read_frontistr(control)
    assert re.search(r"case\.(msh|cnt): line \d+: ", str(caught.value))


def test_what_frontistr_has_and_a_scene_has_not(tmp_path):
    """It is named with its line."""
    case = FrontistrCase(interaction="FSLID, SMOOTHING=NAGATA")
    more = "!SPRING\n BOTTOM, 1, 5.0\n!ULOAD\n!RESTART, FREQUENCY=-1\n!SECTION, SECNUM=1, FORM341=SELECTIVE_ESNS\n"
    case.control = case.control.replace("!SOLVER", f"{more}!RESTART, FREQUENCY=1\n!SOLVER")
    case.control = case.control.replace("!END", "!VISUAL, metod=PSR\n!color_comp_name = STRESS\n!END")
    case.mesh = case.mesh.replace("!CONTACT PAIR", "!MYSTERY\n!CONTACT PAIR")
    study = read_frontistr(case.write(tmp_path))
    lost = " ".join(study.lost)
    assert "!CONTACT: surfaces that are made smooth" in lost
    assert "!SPRING: not known here" in lost
    assert "!ULOAD: not known here" in lost
    assert lost.count("!RESTART: it goes on from a state that is not there") == 1
    assert len(study.lost) == 5
    assert "with tetrahedra of smoothed strains at edges and nodes" in study.formulations
    assert re.search(r"case.msh: line \d+, !MYSTERY: not known here", lost)
    assert study.follows.endswith("!CONTACT")


def test_nodes_between_corners_are_found_by_their_places(tmp_path):
    """Files have the middle nodes of a tetrahedron in several orders."""
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    pairs = [CELLS["tetra10"].nodes[4 + k] for k in range(6)]
    order = [1, 2, 0, 3, 4, 5]
    points = [*corners, *(corners[list(pairs[k])].mean(axis=0) for k in order)]
    case = FrontistrCase()
    lines = ["!NODE", *(f" {n}, {x[0]!r}, {x[1]!r}, {x[2]!r}" for n, x in enumerate(np.array(points).tolist(), 1001))]
    lines += ["!ELEMENT, TYPE=342, EGRP=LOW", f" 501, {', '.join(str(1001 + k) for k in range(6))},"]
    lines += [f" {', '.join(str(1001 + k) for k in range(6, 10))}"]
    case.mesh = case.mesh.replace("!NGROUP", "\n".join(lines) + "\n!NGROUP", 1)
    study = read_frontistr(case.write(tmp_path))
    nodes = next(nodes for kind, nodes in study.mesh.blocks if kind == "tetra10")[0]
    x = study.mesh.points[nodes]
    assert np.allclose(x[4:], [x[list(ends)].mean(axis=0) for ends in pairs])


def test_results_of_frontistr(tmp_path):
    """Time and fields; what is no result is said."""
    case = FrontistrCase()
    result = read_result(case.write(tmp_path).with_name("case.res.0.2"))
    assert result.time == 1.0
    assert set(result.fields) == {"DISPLACEMENT", "CONTACT_NTRACTION"}
    node = case.blocks.nodes((1, 2, 1))[0]
    assert np.array_equal(result.fields["DISPLACEMENT"][result.numbers == node][0], case.displacements[node])
    broken = tmp_path / "case.res.0.3"
    for text in (
        "",
        "*data\n",
        case.result.replace("3 3", "3 a"),
        case.result[:-200],
        case.result.replace("2 0\n", "9 0\n"),
    ):
        broken.write_text(text)
        with pytest.raises(MeshError, match=r"line \d+: "):
            read_result(broken)


def _mutilated(text, dice):
    """A text with one thing wrong: a line is lost, doubled or moved, a word is changed, or the end is missing."""
    lines = text.split("\n")
    at = dice.randrange(len(lines))
    match dice.randrange(6):
        case 0:
            del lines[at]
        case 1:
            lines.insert(at, lines[dice.randrange(len(lines))])
        case 2:
            lines = lines[:at]
        case 3:
            words = lines[at].split(" ")
            k = dice.randrange(len(words))
            words[k] = dice.choice(
                ["", "-1", "1e999", "nan", "Begin", "}", "!", "[", '"', "99999999999999999999", "\x00"]
            )
            lines[at] = " ".join(words)
        case 4:
            k = dice.randrange(len(lines[at]) + 1)
            lines[at] = lines[at][:k] + dice.choice('"{}[],:-!#eE.\t') + lines[at][k:]
        case 5:
            k = dice.randrange(len(lines[at]) + 1)
            lines[at] = lines[at][:k] + lines[at][k + 1 :]
    return "\n".join(lines)


@pytest.mark.parametrize("program", ["Kratos", "FrontISTR"])
def test_mutilated_files(tmp_path, program):
    """Of 150 files that have something wrong each is read, as what is wrong does not matter, or ends in one error with
    its file and line, and in nothing else.
    """
    dice = random.Random(73)
    messages = []
    for number in range(150):
        folder = tmp_path / str(number)
        folder.mkdir()
        case = KratosCase() if program == "Kratos" else FrontistrCase()
        file = case.write(folder)
        names = ("case.mdpa", "case_parameters.json", "case_materials.json")
        names = names if program == "Kratos" else ("case.msh", "case.cnt")
        spoiled = file.with_name(dice.choice(names))
        spoiled.write_text(_mutilated(spoiled.read_text(), dice))
        messages += list(_errors(program, file))
    for message in messages:
        assert "\n" not in message
        assert re.search(r"line \d+", message), message
    assert len(messages) > 60


def _errors(program, file):
    """What is wrong with a case; nothing: it becomes a scene."""
    try:
        study = read_kratos(file) if program == "Kratos" else read_frontistr(file)
        draft_study(study, file, file.parent.parent / "case.toml", "case")
    except MeshError as error:
        yield str(error)


def test_a_process_is_found_by_its_module(tmp_path):
    """Also with the name of its application before it, and by the name alone."""
    case = KratosCase()
    case.parameters["processes"]["more"] = [process("KratosMultiphysics.vtk_output_process")]
    case.parameters["processes"]["most"] = [{"process_name": "mystery", "Parameters": {}}]
    study = kratos_study(tmp_path, case)
    assert [lost.partition(", ")[2] for lost in study.lost] == ["mystery: not known here"]
    assert json.loads(json.dumps(case.parameters))  # the case itself is unchanged


def test_a_plane_law_in_elements_of_revolution(tmp_path):
    """It is said, as such elements have no hoop stress in Kratos."""
    case = KratosCase("axis")
    for entry in case.materials:
        entry["Material"]["constitutive_law"]["name"] = "LinearElasticPlaneStrain2DLaw"
    study = kratos_study(tmp_path, case)
    assert study.model == "AXIS"
    assert all("a plane law in elements of revolution" in lost for lost in study.lost)
    assert len(study.lost) == 2


def test_pressure_that_follows_the_boundary(tmp_path):
    """In nonlinear statics FrontISTR's pressure does, with small strains too: the size of rotations decides."""
    case = FrontistrCase()
    assert read_frontistr(case.write(tmp_path)).finite == "line 9, !DLOAD: a pressure that follows the boundary"
    case.control = case.control.replace("NLSTATIC", "STATIC")
    assert read_frontistr(case.write(tmp_path)).finite == ""
