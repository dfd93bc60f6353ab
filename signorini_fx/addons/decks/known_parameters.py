"""The parameters of each keyword that are known.  All others are reported as lost by their names.

A known parameter is either read, or does not change the solution, such as controls of the solver.
After ``=`` stand the only known values, without blanks; an empty one means a parameter without a
value.  INPUT names a file and may belong to any keyword.
"""

from __future__ import annotations

from collections.abc import Mapping

_SECTION = "ELSET MATERIAL ORIENTATION CONTROLS"
_LOAD = "OP=MOD|NEW AMPLITUDE TIMEDELAY"
KNOWN: dict[str, str] = {
    # Structure of the file, and the mesh.
    **dict.fromkeys(("HEADING", "SYSTEM", "ENDSTEP", "INCLUDE"), ""),
    **dict.fromkeys(("ENDPART", "ENDINSTANCE", "ENDASSEMBLY"), ""),
    **dict.fromkeys(("PART", "ASSEMBLY", "MATERIAL"), "NAME"),
    "INSTANCE": "NAME PART",
    "NODE": "NSET SYSTEM",
    "ELEMENT": "TYPE ELSET",
    "NSET": "NSET ELSET GENERATE INSTANCE INTERNAL UNSORTED",
    "ELSET": "ELSET GENERATE INSTANCE INTERNAL UNSORTED",
    "SURFACE": "NAME TYPE=ELEMENT|NODE INTERNAL",
    # Sections and materials.
    "SOLIDSECTION": _SECTION,
    "SHELLSECTION": f"{_SECTION} OFFSET SECTIONINTEGRATION",
    "MEMBRANESECTION": _SECTION,
    "DENSITY": "",
    "MASS": "ELSET TYPE",
    "ELASTIC": "TYPE MODULI=LONGTERM",
    "EXPANSION": "TYPE ZERO",
    "HYPERELASTIC": "NEOHOOKE MOONEY-RIVLIN OGDEN POLYNOMIAL REDUCEDPOLYNOMIAL N MODULI=LONGTERM",
    "PLASTIC": "HARDENING EXTRAPOLATION=CONSTANT",
    # Contact.
    "SURFACEINTERACTION": "NAME USER UNSYMM",
    "FRICTION": "ROUGH TAUMAX SLIPTOLERANCE ELASTICSLIP LAGRANGE",
    "SURFACEBEHAVIOR": "PRESSURE-OVERCLOSURE NOSEPARATION DIRECT PENALTY AUGMENTEDLAGRANGE",
    "CONTACTPAIR": "INTERACTION TYPE ADJUST TIED SMALLSLIDING NOTHICKNESS TRACKING "
    "EXTENSIONZONE HCRIT SUPPLEMENTARYCONSTRAINTS",
    "TIE": "NAME ADJUST=|YES|NO POSITIONTOLERANCE CYCLICSYMMETRY NOROTATION NOTHICKNESS "
    "TYPE=SURFACETOSURFACE|NODETOSURFACE",
    "PRE-TENSIONSECTION": "SURFACE NODE",
    # Steps and loads.
    "STEP": "NAME INC INCF NLGEOM=|YES|NO PERTURBATION AMPLITUDE UNSYMM EXTRAPOLATION CONVERTSDI",
    "STATIC": "DIRECT SOLVER",
    "AMPLITUDE": "NAME TIME=STEPTIME|TOTALTIME DEFINITION VALUE=RELATIVE",
    "BOUNDARY": f"{_LOAD} TYPE FIXED SUBMODEL USER",
    **dict.fromkeys(("CLOAD", "DLOAD"), _LOAD),
    "DSLOAD": f"{_LOAD} FOLLOWER CONSTANTRESULTANT",
    "TEMPERATURE": f"{_LOAD} FILE BSTEP USER LINTEMP",
    "INITIALCONDITIONS": "TYPE FILE",
    "RESTART": "WRITE FREQUENCY NUMBERINTERVAL TIMEMARKS OVERLAY",
}


def squeezed(word: str) -> str:
    """Return a keyword, a parameter or a value in capitals and without blanks."""
    return "".join(word.split()).upper()


def _values_of(keyword: str) -> dict[str, list[str]]:
    """Return the known values of each known parameter of a keyword; an empty list means that all
    values are known.
    """
    pairs = (word.partition("=") for word in f"INPUT {KNOWN[keyword]}".split())
    return {name: values.split("|") if equals else [] for name, equals, values in pairs}


def is_parameter(keyword: str, word: str) -> bool:
    """Return whether a word is a known parameter of a keyword, whatever its value."""
    return word in _values_of(keyword) if keyword in KNOWN else False


def unread_parameters(keyword: str, parameters: Mapping[str, str]) -> list[str]:
    """Return the parameters of a keyword that are not read, as ``NAME`` or ``NAME=VALUE``."""
    if keyword not in KNOWN:
        return []
    known = _values_of(keyword)
    unread = []
    for name, value in parameters.items():
        values = known.get(name)
        if values is None or (values and squeezed(value) not in values):
            unread.append(f"{name}={value}" if value else name)
    return unread
