"""The keywords of an Abaqus input file that are not read, by whether the solution changes, with the
reason.

Keywords that are read in part are reported by their readers.  The tests read a deck with each of
these keywords.
"""

from __future__ import annotations

UNKNOWN = "not read"
CONSTRAINT = "a constraint between nodes is not read"
CHANGED_WITHIN = "a change within a step is not read: the first value holds"
WITHOUT_EFFECT = "without effect in static steps"
OTHER_PROCEDURE = "only static steps are read"
NO_BODY_PART = "no part of the body"


def _each(effect: str, *names: str) -> dict[str, str]:
    """Return one reason for several keywords, whose blanks are removed, as Abaqus and CalculiX
    ignore them.
    """
    return dict.fromkeys((name.replace(" ", "") for name in names), effect)


# Keywords that change the answer; so do those that are in no table.
LOST = {
    **_each(CHANGED_WITHIN, "CHANGE FRICTION", "CHANGE SURFACE BEHAVIOR"),
    **_each(NO_BODY_PART, "BEAM SECTION"),
    **_each("rotated axes of nodes are not read", "TRANSFORM"),
    **_each(
        OTHER_PROCEDURE,
        *("FREQUENCY", "COMPLEX FREQUENCY", "BUCKLE", "DYNAMIC", "MODAL DYNAMIC"),
        *(
            "STEADY STATE DYNAMICS",
            "STEADY STATE TRANSPORT",
            "HEAT TRANSFER",
            "VISCO",
            "GREEN",
            "CFD",
            "SENSITIVITY",
        ),
        *(
            "COUPLED TEMPERATURE-DISPLACEMENT",
            "UNCOUPLED TEMPERATURE-DISPLACEMENT",
            "COUPLED THERMAL-ELECTRICAL",
        ),
        *(
            "SUBSTRUCTURE GENERATE",
            "ANNEAL",
            "ELECTROMAGNETICS",
            "NO ANALYSIS",
            "RANDOM RESPONSE",
            "GEOSTATIC",
        ),
        *(
            "RESPONSE SPECTRUM",
            "SOILS",
            "MASS DIFFUSION",
            "DIRECT CYCLIC",
            "CRACK PROPAGATION",
            "ROBUST DESIGN",
        ),
        "FEASIBLE DIRECTION",
    ),
    **_each("general contact is not read: name pairs of surfaces", "CONTACT", "CONTACT INCLUSIONS"),
    **_each("clearances are those of the mesh", "CLEARANCE"),
    **_each(
        "parts and contacts that come or go are not read: all are there throughout", "MODEL CHANGE"
    ),
    **_each(
        "rigid bodies are not read: give the shape as foundation of a contact, or its distance as "
        "gap",
        "RIGID BODY",
    ),
    **_each(
        *(CONSTRAINT, "EQUATION", "MPC", "COUPLING", "KINEMATIC", "DISTRIBUTING"),
        *("DISTRIBUTING COUPLING", "CYCLIC SYMMETRY MODEL"),
    ),
}
# Keywords that do not change it.
NOTED = {
    **_each("without effect on isotropic materials", "ORIENTATION"),
    **_each(
        *(WITHOUT_EFFECT, "CONDUCTIVITY", "SPECIFIC HEAT", "PHYSICAL CONSTANTS", "DAMPING"),
        *(
            "GAP CONDUCTANCE",
            "GAP HEAT GENERATION",
            "CONTACT DAMPING",
            "DESIGN VARIABLES",
            "VIEW FACTOR",
            "CFLUX",
        ),
        *("DFLUX", "FILM", "RADIATE", "EMISSIVITY"),
    ),
    **_each(
        "not written: fields.vtu and contact.csv of the result have all values",
        *("NODE PRINT", "EL PRINT", "FACE PRINT", "SECTION PRINT", "CONTACT PRINT"),
        *("NODE FILE", "EL FILE", "CONTACT FILE"),
    ),
}
# Other requests for output, and control of the solver, which a scene in static steps does not need.
OUTPUT = _each(
    *(
        "",
        "PREPRINT",
        "OUTPUT",
        "NODE OUTPUT",
        "ELEMENT OUTPUT",
        "CONTACT OUTPUT",
        "FIELD OUTPUT",
    ),
    *(
        "HISTORY OUTPUT",
        "PRINT",
        "ENERGY OUTPUT",
        "ENERGY PRINT",
        "MONITOR",
        "FILE FORMAT",
        "CONTROLS",
    ),
    *("HOURGLASS STIFFNESS", "TIME POINTS"),
)
