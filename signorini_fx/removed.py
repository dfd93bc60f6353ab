"""Names that left the package, and what to use instead of each."""

from __future__ import annotations

import re

# A name as its user writes it -> what to do instead.  Keys of scenes have their path without
# positions in lists, and a value follows its key after " = ".  Commands and their options begin
# with "signorini-fx".  What is left are public names of Python and names of add-ons.
INSTEAD: dict[str, str] = {
    "CoulombFriction": "use Coulomb",
    "TrescaFriction": "use Tresca",
    "mean_displacement_bounds": "use error_bound, or force_bounds at a boundary in contact",
    "solver.algorithm = exact": "use 'alm', which has the same limit",
    "accuracy.certified": "set solver.error_bound = true: the summary has a guaranteed bound of "
    "the error",
    "solver.uniqueness": "signorini-fx check --verbose says below which friction coefficient "
    "there is one solution",
    "Box": "give solver.initial_contact a condition, such as '1 <= x[0] <= 2'",
    "mesh.contact_size": "write contact_size in each [[contact]]",
    "fluid.enters": "state the uplift as a traction with a pressure on the contact boundary",
    "fluid.closed": "state the uplift as a traction with a pressure on the contact boundary",
    **{
        f"{load}.live": "leave it out: friction_used is of all loads, and a ramp "
        "(load_steps.steps) finds the limit"
        for load in (
            "traction",
            "force",
            "point_force",
            "fluid",
            "body_force",
            "gravity",
            "rotation",
        )
    },
    "SweepPoint": "sweep gives a Solution for each value",
    "title_block": "write it into title, which heads the report",
    "TitleBlock": "write it into title, which heads the report",
    "links": "tie bodies by a contact with kind = 'bonded'; MPCs of forms of your own are those "
    "of dolfinx_mpc",
    "Links": "tie bodies by BondedContact",
    "rigid": "give its shape as foundation of each of its contacts, all with rigid = 'NAME', one "
    "with its other keys",
    "periodic_sides": "model several periods, of which the one in the middle counts",
    "point_force.file": "write one [[point_force]] with 'at' for each node",
    **dict.fromkeys(
        [f"mesh.generator = {name}" for name in ("block_on_cylinder", "dovetail", "wedge_block")],
        "draw the body in a .geo, such as demos/blade_foot.geo, and give it as mesh.file",
    ),
    "mesh.generator = notched_sides": "use rectangle with its parameter lower, the height above "
    "which sides are named",
    "contact.overclosure.law = exponential": "use the stiffness at the pressure that is expected: "
    "{ stiffness = ... }",
    "contact.overclosure.law = tabular": "use the stiffness at the pressure that is expected: { "
    "stiffness = ... }",
    "material.poisson_grading": "write one [[material]] for each region of the mesh",
    "contact.foundation.shape = edge": "use 'polyline', in 3D a 'surface' from a file",
    "contact.foundation.shape = spline": "use a 'polyline' through more points of the curve",
    "signorini_fx.interfaces": "state what acts on a boundary as a force, by an effect of group "
    "signorini_fx.effects",
    "signorini-fx compare": "compare the numbers of the two summary.json and contact.csv",
    "signorini-fx gauntlet": "compare a result of another program by signorini-fx judge",
    "signorini-fx judge --alone": "leave it out: the distance from our solution is the verdict",
    "signorini-fx run": "signorini-fx new SCENE --from DECK drafts a deck; then solve and report",
    "signorini-fx open": "signorini-fx report FOLDER writes report.html: open it in a browser",
    "signorini-fx sensitivity": "call signorini_fx.sensitivity(scene, results, by) in Python",
    "signorini-fx convert": "signorini-fx new SCENE --from DECK drafts a deck; gmsh and meshio "
    "convert meshes",
    "signorini-fx completion": "signorini-fx --help lists the commands, signorini-fx COMMAND "
    "--help the options",
    "signorini-fx solve --levels": "use --set solver.levels=N",
    "signorini-fx solve --adaptive": "use --set accuracy.refinement=adaptive",
    "signorini-fx solve --budget": "use --set accuracy.seconds=60 or --set accuracy.memory=4, in "
    "GB",
    "signorini-fx solve --picture principal": "look at principal_stresses of fields.vtu in "
    "ParaView",
    "signorini-fx solve --fields": "leave it out: ParaView, PyVista and meshio open fields.vtu",
    "signorini-fx work-precision": "set accuracy.target in the scene, by which meshes and their "
    "number are chosen",
}


def removal(name: str, *, whole: bool = False) -> str:
    """What to say of a key that is not known, such as ``was removed: use 'alm'``; "": it has never
    been there.  Unless it is ``whole``, a path may begin below the top of the scene, as that of a
    table made in Python does.
    """
    path = re.sub(r"\[\d+\]", "", name)
    for removed, instead in INSTEAD.items():
        if removed == path or (not whole and removed.endswith(f".{path}")):
            return f"was removed: {instead}"
    return ""
