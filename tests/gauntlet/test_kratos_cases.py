"""Test cases of Kratos and of FrontISTR: blocks pressed together, whose answer is known, and how cases end."""

import json
from dataclasses import replace

import numpy as np
import pytest
from block_cases import PRESSURE, YOUNG, FrontistrCase, KratosCase, exact, process

from signorini_fx.addons.gauntlet.frontistr import FrontistrRun
from signorini_fx.addons.gauntlet.gauntlet import gauntlet, run_case
from signorini_fx.addons.gauntlet.kratos import KratosRun
from signorini_fx.addons.gauntlet.outcomes import LOST, OTHER_KIND, REFUSED, WHOLE
from signorini_fx.addons.gauntlet.page import page
from signorini_fx.addons.gauntlet.sources import cases_of, name_of

# Hard contact gives way by the pressure over a stiffness of 1e5 times that of the blocks, whose own displacement at the
# contact is half of that at the top.
AGREES = 3e-5


def outcome(folder, case):
    """Of a case that is run in this process."""
    file = case.write(folder)
    out = folder / "out"
    out.mkdir()
    run = FrontistrRun if isinstance(case, FrontistrCase) else KratosRun
    return run(file, out, lambda case: None).outcome()


@pytest.mark.parametrize(
    ("model", "options"),
    [
        ("strain", {}),
        ("stress", {}),
        ("axis", {}),
        ("space", {}),
        ("space", {"tetrahedra": True}),
        ("strain", {"element": "TotalLagrangianElement"}),
    ],
)
def test_blocks_pressed(tmp_path, model, options):
    """Displacement and pressure at both times are exact."""
    case = outcome(tmp_path, KratosCase(model, **options))
    assert (case.name, case.program, case.state, case.why) == ("folder/case", "Kratos", WHOLE, "")
    assert [quantity.name.partition(",")[0] for quantity in case.quantities] == ["displacement", "contact pressure"]
    assert case.difference < AGREES
    assert case.quantities[1].theirs == PRESSURE


@pytest.mark.parametrize("where", ["first time", "last time", "pressure"])
def test_a_difference_is_seen(tmp_path, where):
    """One value of one node at one time, of either quantity."""
    case = KratosCase("strain")
    name = "AUGMENTED_NORMAL_CONTACT_PRESSURE" if where == "pressure" else "DISPLACEMENT_Y"
    node = f"NODE_{case.blocks.nodes((1, 1, 0))[1]}"
    place = 0 if where == "first time" else 1
    largest = abs(exact([1.0, 1.0, 0.0], "strain")[1]) if where != "pressure" else PRESSURE
    case.results[node][name][place] += 0.1 * largest
    ended = outcome(tmp_path, case)
    assert ended.state == WHOLE
    assert ended.difference == pytest.approx(0.1, rel=1e-3)
    assert any("augmented Lagrangian" in reason for reason in ended.reasons)
    assert any("with sides half as long ours moves by" in reason for reason in ended.reasons)


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("model", ["strain", "space"])
@pytest.mark.parametrize("side", ["POSITIVE", "NEGATIVE"])
def test_pressure_of_a_face(tmp_path, model, turned, side):
    """As Kratos 10.4.4 takes it: along the normal of the condition in the plane, against it in space, and a negative
    one the other way.  The normal of a side from a to b is to its right; conditions here point down in the plane and up
    in space, unless they are turned.
    """
    case = KratosCase(model, turned=turned)
    inwards = (model == "strain") != turned
    pushes = inwards == (model == "strain")
    sign = 1.0 if pushes == (side == "POSITIVE") else -1.0
    case.parameters["processes"]["loads"] = [
        process(
            "assign_scalar_variable_to_conditions_process",
            "Top",
            variable_name=f"{side}_FACE_PRESSURE",
            value=f"{sign * PRESSURE} * t",
        )
    ]
    ended = outcome(tmp_path, case)
    assert (ended.state, ended.why) == (WHOLE, "")
    assert ended.difference < AGREES


def test_components_of_a_load_and_its_course(tmp_path):
    """What comes later in the list replaces the earlier; a load stays as it was where its interval ends."""
    case = KratosCase("strain")
    module = "assign_scalar_variable_to_conditions_process"
    case.parameters["processes"]["loads"] = [
        process(module, "Top", variable_name="LINE_LOAD_Y", value=-99.0, interval=[0.0, "End"]),
        process(module, "Top", variable_name="LINE_LOAD_Y", value=f"-{PRESSURE}*t^1", interval=[0.0, 0.5]),
    ]
    case.results = {
        key: value if key == "TIME" else {name: [series[0]] * 2 for name, series in value.items()}
        for key, value in case.results.items()
    }
    case.parameters["processes"]["loads"].reverse()
    assert outcome(tmp_path, case).difference > 1
    case.parameters["processes"]["loads"].pop()
    second = tmp_path / "second"
    second.mkdir()
    assert outcome(second, case).difference < AGREES


def test_a_support_that_ends(tmp_path):
    """The top is held at the first time, and pressed at the second one: both times have the same answer as a load."""
    case = KratosCase("strain")
    case.parameters["processes"]["loads"][0]["Parameters"]["interval"] = [0.6, "End"]
    value = f"t * {exact([0.0, 2.0, 0.0], 'strain')[1]}"
    case.parameters["processes"]["constraints"].append(
        process("assign_scalar_variable_process", "Top", variable_name="DISPLACEMENT_Y", value=value, interval=[0, 0.6])
    )
    ended = outcome(tmp_path, case)
    assert (ended.state, ended.why) == (WHOLE, "")
    assert ended.difference < AGREES


def test_tied_blocks_hang(tmp_path):
    """A bond carries tension, where contact would open."""
    case = KratosCase("strain")
    loads = case.parameters["processes"]["loads"][0]["Parameters"]
    loads["direction"] = [-part for part in loads["direction"]]
    case.parameters["processes"]["contact"] = [
        process("mesh_tying_process", mesh_tying_model_part={"0": ["Contact"]}, assume_master_slave={"0": ["Up"]})
    ]
    for name, entry in case.results.items():
        if name != "TIME":
            entry.pop("AUGMENTED_NORMAL_CONTACT_PRESSURE")
            for series in entry.values():
                series[:] = [-value for value in series]
    ended = outcome(tmp_path, case)
    assert (ended.state, ended.why) == (WHOLE, "")
    assert ended.difference < AGREES


def test_a_rigid_movement_links_nodes(tmp_path):
    """All nodes of the right-hand sides move as one along x: as they do without it, where pressure is uniform."""
    case = KratosCase("strain")
    case.parts["Far"] = (case.blocks.nodes((0, 0, 1), (1, 0, 1)), (), ())
    link = process("impose_rigid_movement_process", master_variable_name="DISPLACEMENT_X")
    link["Parameters"]["model_part_name"] = "Far"
    case.parameters["processes"]["constraints"].append(link)
    ended = outcome(tmp_path, case)
    assert (ended.state, ended.why) == (WHOLE, "")
    assert ended.difference < AGREES


def test_weight_of_the_upper_block(tmp_path):
    """The lower block carries the weight of the upper one, and none of its own: all pressures are rho g."""
    case = KratosCase("strain")
    case.parameters["processes"]["loads"] = [
        process(
            "assign_vector_by_direction_process",
            "Up",
            variable_name="VOLUME_ACCELERATION",
            modulus=f"{PRESSURE / 2.0} * t",
            direction=[0.0, -1.0, 0.0],
        )
    ]
    lower = set(case.blocks.nodes((0, 1, 1)))
    for key in list(case.results):
        if key != "TIME" and int(key.removeprefix("NODE_")) not in lower:
            del case.results[key]
    ended = outcome(tmp_path, case)
    assert (ended.state, ended.why) == (WHOLE, "")
    assert ended.quantities[0].difference < AGREES


def test_a_slope_that_supports_hold_on_both_sides(tmp_path):
    """Nodes of whole sides that may touch, held along an axis: a scene has links for them."""
    case = KratosCase("strain")
    for number, x in case.blocks.points.items():
        if number in case.parts["Contact"][0]:
            x[1] += 0.5 * x[0] - 0.25
    for name in ("Low", "Up"):
        case.parameters["processes"]["constraints"].append(
            process("assign_scalar_variable_process", name, variable_name="DISPLACEMENT_X", value=0.0)
        )
    modulus = YOUNG * 0.75 / (1.25 * 0.5)
    for node in case.parts["Contact"][0]:
        entry = case.results[f"NODE_{node}"]
        u = -PRESSURE / modulus * case.blocks.points[node][1]
        entry["DISPLACEMENT_X"], entry["DISPLACEMENT_Y"] = [0.0, 0.0], [0.5 * u, u]
        entry.pop("AUGMENTED_NORMAL_CONTACT_PRESSURE")
    ended = outcome(tmp_path, case)
    assert (ended.state, ended.why) == (WHOLE, "")
    assert ended.difference < 1e-3


@pytest.mark.parametrize(("factor", "state"), [(1.0, WHOLE), (60.0, LOST)])
def test_large_strains_are_told(tmp_path, factor, state):
    """Elements of large strains: where linear elasticity neglects more than a hundredth of its strain, it is said."""
    case = KratosCase("strain", element="UpdatedLagrangianElement")
    case.parameters["processes"]["loads"][0]["Parameters"]["modulus"] = f"{factor * PRESSURE} * t"
    ended = outcome(tmp_path, case)
    assert ended.state == state
    assert ("UpdatedLagrangianElement2D4N: NLGEOM" in ended.why) == (state == LOST)


def test_what_is_lost_is_named(tmp_path):
    """Each with its line and name."""
    case = KratosCase("strain")
    touching = case.parameters["processes"]["contact"][0]
    touching["python_module"] = "penalty_contact_process"
    case.parameters["processes"]["loads"] += [
        process("my_own_process", "Top"),
        process("assign_scalar_variable_process", "Top", variable_name="TEMPERATURE", value=3.0),
    ]
    ended = outcome(tmp_path, case)
    assert ended.state == LOST
    assert "penalty_contact_process: the penalty that Kratos computes: contact is hard here" in ended.why
    assert "my_own_process: not known here" in ended.why
    assert "assign_scalar_variable_process: TEMPERATURE: not known here" in ended.why
    assert ended.difference < AGREES


def test_values_of_something_else(tmp_path):
    """A case without a value that both have says so."""
    case = KratosCase("strain")
    case.parameters["processes"]["check"][0]["Parameters"]["check_variables"] = ["LAGRANGE_MULTIPLIER_CONTACT_PRESSURE"]
    for name, entry in case.results.items():
        if name != "TIME":
            entry["LAGRANGE_MULTIPLIER_CONTACT_PRESSURE"] = [1.0, 2.0]
    ended = outcome(tmp_path, case)
    assert ended.quantities == ()
    assert ended.why.endswith("all of something else than both have")
    case.results = {"TIME": []}
    second = tmp_path / "second"
    second.mkdir()
    assert outcome(second, case).why == "Kratos' file has no value"


def test_dynamics_is_another_kind(tmp_path):
    """It needs no process of its own."""
    case = KratosCase("strain")
    case.parameters["solver_settings"]["solver_type"] = "Dynamic"
    ended = run_case(case.write(tmp_path), 100.0)
    assert (ended.state, ended.seconds) == (OTHER_KIND, 0.0)
    assert "solver_type 'Dynamic': only static steps are taken" in ended.why
    frontistr = FrontistrCase()
    frontistr.control = frontistr.control.replace("NLSTATIC", "DYNAMIC")
    second = tmp_path / "second"
    second.mkdir()
    ended = run_case(frontistr.write(second), 100.0)
    assert ended.state == OTHER_KIND
    assert "line 3, !SOLUTION: TYPE=DYNAMIC: only static steps are taken" in ended.why


@pytest.mark.parametrize("surfaces", [True, False])
@pytest.mark.parametrize("tetrahedra", [False, True])
def test_blocks_of_frontistr(tmp_path, tetrahedra, surfaces):
    """Displacement and pressure are exact, of surfaces and of nodes against a surface."""
    case = outcome(tmp_path, FrontistrCase(tetrahedra=tetrahedra, surfaces=surfaces))
    assert (case.name, case.program, case.state, case.why) == ("folder/case", "FrontISTR", WHOLE, "")
    assert [quantity.name.partition(",")[0] for quantity in case.quantities] == ["displacement", "contact pressure"]
    assert case.difference < AGREES


def test_a_difference_of_frontistr(tmp_path):
    """It is seen, and judged."""
    case = FrontistrCase()
    node = case.blocks.nodes((1, 2, 1))[0]
    case.displacements = {n: u * (1.1 if n == node else 1.0 + 1e-7) for n, u in case.displacements.items()}  # 8 digits
    ended = outcome(tmp_path, case)
    assert ended.difference == pytest.approx(0.1 / 1.1, rel=1e-3)  # of theirs, which is the larger one
    assert any("hexahedra of F-bar" in reason for reason in ended.reasons)
    assert any(reason.startswith("judge says of theirs: not in equilibrium") for reason in ended.reasons)


def test_steps_of_frontistr(tmp_path):
    """Displacements add up over steps; a load stays in the step after the one in which it grew."""
    case = FrontistrCase()
    step = case.control[case.control.index("!STEP") : case.control.index("!SOLVER")]
    case.control = case.control.replace("!SOLVER", f"{step}!SOLVER").replace("BOTTOM, 3, 3, 0.0", "BOTTOM, 3, 3, -0.25")
    case.time = 2.0
    for u in case.displacements.values():
        u[2] -= 0.5
    ended = outcome(tmp_path, case)
    assert (ended.state, ended.why) == (WHOLE, "")
    assert ended.difference < AGREES


def test_tied_blocks_of_frontistr_hang(tmp_path):
    """A bond carries tension."""
    case = FrontistrCase(interaction="TIED")
    case.control = case.control.replace(f"TOP, S, {PRESSURE!r}", f"TOP, S, {-PRESSURE!r}")
    case.displacements = {node: -u for node, u in case.displacements.items()}
    case.pressures = {}
    ended = outcome(tmp_path, case)
    assert (ended.state, ended.why) == (WHOLE, "")
    assert ended.difference < AGREES


def test_a_folder_of_both(tmp_path):
    """Cases of both are found, run in processes of their own, and have their pages."""
    kratos = KratosCase("strain")
    kratos.write(tmp_path)
    FrontistrCase().write(tmp_path)
    (tmp_path / "folder" / "broken_parameters.json").write_text(
        json.dumps(kratos.parameters).replace("folder/case_materials.json", "none.json")
    )
    assert [name_of(file) for file in cases_of(tmp_path)] == ["folder/broken", "folder/case", "folder/case"]
    result = gauntlet([tmp_path], seconds=200)
    assert [case.state for case in result.cases] == [REFUSED, WHOLE, WHOLE]
    assert result.cases[0].why == "broken_parameters.json: line 1: materials_filename: none.json is not there"
    assert {case.program for case in result.cases} == {"Kratos", "FrontISTR"}
    text = page(result, "signorini-fx gauntlet folder")
    assert "| folder/case | displacement, y at node" in text
    for program in ("Kratos", "FrontISTR"):
        of_program = replace(result, cases=tuple(case for case in result.cases if case.program == program))
        assert page(of_program, "signorini-fx gauntlet folder").startswith(f"# The gauntlet: {program}\n")
    assert np.isfinite(result.cases[1].difference)
