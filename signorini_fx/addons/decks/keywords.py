"""What becomes of the keywords of an Abaqus input file: its effect on the scene, and whether the answer changes.

``docs/decks.md`` is written from this table, and the tests read a deck with each of its rows.  No dolfinx here.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum


class Grade(StrEnum):
    """Whether a scene has what a keyword says."""

    TAKEN = "is in the scene"
    NOTED = "does not change the answer"
    LOST = "changes the answer"
    REFUSED = "is an error"


@dataclass(frozen=True)
class Rule:
    """What becomes of a keyword.

    Attributes:
        keyword: as it is written, in capitals.
        case: with which parameter or data; empty: in all other cases.
        grade: whether the answer changes.
        effect: what becomes of it; in words that are said where it is not taken.
    """

    keyword: str
    case: str
    grade: Grade
    effect: str

    @property
    def key(self) -> str:
        """The keyword without blanks, which the programs ignore."""
        return self.keyword.replace(" ", "")


def _rules(grade: Grade, effect: str, *keywords: str, case: str = "") -> list[Rule]:
    return [Rule(keyword, case, grade, effect) for keyword in keywords]


CONSTRAINT = "a constraint between nodes"
PARTLY = "a coupling of some components of a surface"
WITHOUT_EFFECT = "without effect in static steps"
SMALL = "NLGEOM: displacements and rotations are taken as small"
FINITE = "NLGEOM: finite strains, law = 'saint-venant-kirchhoff', linear in the strain of Green"
PARTNERS = "points in contact keep their partners"
GOES_ON = "its amplitude goes on in later steps: the value at the end of this one stays"
PERTURBATION = "PERTURBATION: contact may open and close here, and does not in such a step"
TURNED = "axes are rectangular, R, or cylindrical, C; those of space are taken"
NO_SECTORS = "cyclic symmetry without *CYCLIC SYMMETRY MODEL"
UNTOUCHED_SECTOR = "contact of a sector with the next one"
UNKNOWN = "not known to scenes"
OTHER_PROCEDURE = "only static steps are taken"
STATIC = "STATIC"
NO_PROCEDURE = "the step does not say of what kind it is: write *STATIC into it; CalculiX solves nothing in such a step"
OUTSIDE_STEPS = "is expected within a step"
WITHIN_STEP = "is expected before the first step"
AS_BEFORE = "as the step before it: this one does not say of what kind it is"
CHANGED_WITHIN = "a change within a step: what holds at the beginning is taken"
COMING_AND_GOING = "parts that come or go with a later step, or contacts of rigid ones: they are there throughout"
FRICTION_FIRST = (
    "the coefficient changes before the loads of its step, in a step of its own, as in CalculiX with small increments"
)
SUBROUTINE = "behaviour of a subroutine: contact is hard"
NO_CLEARANCE = "a clearance that a file gives node by node, or that a later step changes"
OTHER_BEHAVIOUR = "another stiffness, or a bond, from a step on: the first one is taken"
GENERAL_CONTACT = "general contact: name the pairs of surfaces, in [[contact]]"
OTHER_RUBBER = "only NEO HOOKE, MOONEY-RIVLIN and OGDEN with D1 above 0 are known"
OTHER_HARDENING = "hardening that is not isotropic: elastic here"
YIELDING_RUBBER = "of a material with *HYPERELASTIC: it does not yield here"
BESIDE_RUBBER = "beside rubber: law = 'saint-venant-kirchhoff', linear in the strain of Green"
NOT_YET_NONLINEAR = "not possible yet"
FIRST_LINE = "constants that depend on temperature: the first line is taken"
SECTOR = "forces on a sector of 2 degrees, as CalculiX prints them"
NOT_WRITTEN = "not written"
LOAD_AREA = "shells without thickness: only the area of their pressure"
# Of the tables that output is asked for, those that are written, by their words: U, RF of *NODE PRINT and so on.
WRITTEN = {
    **{"NODEPRINT": (".dat", ("U", "RF")), "CONTACTPRINT": (".dat", ("CDIS", "CSTR"))},
    **{"ELPRINT": (".dat", ()), "FACEPRINT": (".dat", ()), "SECTIONPRINT": (".dat", ())},
    **{"NODEFILE": (".frd", ("U", "RF")), "ELFILE": (".frd", ("S",)), "CONTACTFILE": (".frd", ("CDIS", "CSTR"))},
}
_STRESSED = "as a plane body under plane stress, without bending"
PROCEDURES = (
    *("FREQUENCY", "COMPLEX FREQUENCY", "BUCKLE", "DYNAMIC", "MODAL DYNAMIC", "STEADY STATE DYNAMICS"),
    *("STEADY STATE TRANSPORT", "HEAT TRANSFER", "VISCO", "COUPLED TEMPERATURE-DISPLACEMENT"),
    *("UNCOUPLED TEMPERATURE-DISPLACEMENT", "COUPLED THERMAL-ELECTRICAL", "GREEN", "SUBSTRUCTURE GENERATE"),
    *("SENSITIVITY", "CFD", "ANNEAL", "ELECTROMAGNETICS", "NO ANALYSIS", "RANDOM RESPONSE", "RESPONSE SPECTRUM"),
    *("GEOSTATIC", "SOILS", "MASS DIFFUSION", "DIRECT CYCLIC", "CRACK PROPAGATION", "ROBUST DESIGN"),
    "FEASIBLE DIRECTION",
)
_MESH = ("NODE", "ELEMENT", "NSET", "ELSET", "SURFACE", "PART", "END PART", "ASSEMBLY", "END ASSEMBLY", "INSTANCE")
_LOADS = ("CLOAD", "DLOAD", "DSLOAD", "TEMPERATURE", "MODEL CHANGE")
_OUTPUT = (
    *("PREPRINT", "RESTART", "OUTPUT", "NODE OUTPUT", "ELEMENT OUTPUT", "CONTACT OUTPUT", "FIELD OUTPUT"),
    *("HISTORY OUTPUT", "PRINT", "ENERGY OUTPUT", "ENERGY PRINT", "MONITOR", "FILE FORMAT", "CONTROLS"),
    *("HOURGLASS STIFFNESS", "TIME POINTS"),
)
_OTHER_PHYSICS = (
    *("CONDUCTIVITY", "SPECIFIC HEAT", "PHYSICAL CONSTANTS", "GAP CONDUCTANCE", "GAP HEAT GENERATION", "DAMPING"),
    *("CONTACT DAMPING", "DESIGN VARIABLES", "VIEW FACTOR", "CFLUX", "DFLUX", "FILM", "RADIATE", "EMISSIVITY"),
)
RULES: tuple[Rule, ...] = (
    *_rules(Grade.TAKEN, "mesh, and names of boundaries and regions", *_MESH, "END INSTANCE"),
    *_rules(Grade.TAKEN, "the lines of another file of the folder", "INCLUDE"),
    *_rules(Grade.TAKEN, "title", "HEADING"),
    *_rules(Grade.TAKEN, "material", "MATERIAL", "ELASTIC", "EXPANSION", "DENSITY", "ORIENTATION", "SOLID SECTION"),
    *_rules(Grade.TAKEN, "material of bodies in contact", "HYPERELASTIC", "PLASTIC"),
    *_rules(Grade.REFUSED, OTHER_RUBBER, "HYPERELASTIC", case="another energy, or incompressible"),
    *_rules(Grade.REFUSED, f"{NOT_YET_NONLINEAR} with links and more", "HYPERELASTIC", case="elsewhere"),
    *_rules(Grade.LOST, OTHER_HARDENING, "PLASTIC", case="HARDENING other than ISOTROPIC"),
    *_rules(Grade.LOST, f"{NOT_YET_NONLINEAR} with links and more: elastic here", "PLASTIC", case="elsewhere"),
    *_rules(Grade.LOST, YIELDING_RUBBER, "PLASTIC", case="of rubber"),
    *_rules(Grade.NOTED, BESIDE_RUBBER, "SOLID SECTION", case="beside rubber"),
    *_rules(Grade.LOST, FIRST_LINE, "ELASTIC", "EXPANSION", case="several temperatures"),
    *_rules(Grade.LOST, CHANGED_WITHIN, "ELASTIC", "EXPANSION", "FRICTION", "SURFACE BEHAVIOR", case="within a step"),
    *_rules(Grade.LOST, CHANGED_WITHIN, "HYPERELASTIC", "PLASTIC", case="within a step"),
    *_rules(Grade.NOTED, _STRESSED, "SHELL SECTION", "MEMBRANE SECTION", case="of a plane mesh"),
    *_rules(Grade.NOTED, LOAD_AREA, "SHELL SECTION", case="thin as nothing, on a side"),
    *_rules(Grade.LOST, "no part of the body", "BEAM SECTION"),
    *_rules(Grade.LOST, "no part of the body", "SHELL SECTION", "MEMBRANE SECTION", case="of no part of the mesh"),
    *_rules(Grade.LOST, "no part of the body", "ELEMENT", case="springs, gaps, connectors"),
    *_rules(Grade.LOST, UNKNOWN, "GAP", "CONNECTOR FRICTION"),
    *_rules(
        *(Grade.REFUSED, "nodes and elements are not generated here"),
        *("NGEN", "NFILL", "NCOPY", "NMAP", "ELGEN", "ELCOPY"),
    ),
    *_rules(Grade.REFUSED, "coordinates are expected along x, y and z", "SYSTEM", case="of other axes"),
    *_rules(Grade.REFUSED, "coordinates are expected along x, y and z", "NODE", case="SYSTEM other than R"),
    *_rules(Grade.LOST, "beside elements of another kind", "ELEMENT", case="CPE, CPS and CAX in one file"),
    *_rules(Grade.TAKEN, "directions of supports and forces at nodes", "TRANSFORM"),
    *_rules(Grade.LOST, TURNED, "TRANSFORM", case="TYPE other than R, C"),
    *_rules(Grade.TAKEN, "load step", "STEP", STATIC, "END STEP"),
    *_rules(Grade.NOTED, AS_BEFORE, "STEP", case="a later one without *STATIC"),
    *_rules(Grade.REFUSED, NO_PROCEDURE, "STEP", case="the first one without *STATIC"),
    *_rules(Grade.REFUSED, "the step before it has no *END STEP", "STEP", case="within another one"),
    *_rules(Grade.REFUSED, OUTSIDE_STEPS, STATIC, *_LOADS, case="outside of steps"),
    *_rules(Grade.REFUSED, OUTSIDE_STEPS, "BOUNDARY", case="between steps"),
    *_rules(Grade.REFUSED, WITHIN_STEP, "INITIAL CONDITIONS", case="within a step"),
    *_rules(Grade.NOTED, SMALL, "STEP", case="NLGEOM; small rotations"),
    *_rules(Grade.TAKEN, FINITE, "STEP", case="NLGEOM; run finds rotations that matter"),
    *_rules(Grade.LOST, SMALL, "STEP", case="NLGEOM; with what finite strains are not possible yet"),
    *_rules(Grade.NOTED, PARTNERS, "STEP", case="NLGEOM; solids of degree 2, ties; run finds that it matters little"),
    *_rules(Grade.LOST, PARTNERS, "STEP", case="NLGEOM; run finds that it matters"),
    *_rules(Grade.LOST, PERTURBATION, "STEP", case="PERTURBATION"),
    *_rules(Grade.LOST, OTHER_PROCEDURE, *PROCEDURES),
    *_rules(Grade.TAKEN, "factors of load steps", "AMPLITUDE"),
    *_rules(Grade.LOST, "the whole load is taken", "AMPLITUDE", case="DEFINITION other than TABULAR, SMOOTH STEP"),
    *_rules(Grade.LOST, GOES_ON, "AMPLITUDE", case="TIME=TOTAL TIME, of temperatures, bolts and loads on shells"),
    *_rules(Grade.TAKEN, "displacement, prescribed motion of rigid bodies", "BOUNDARY"),
    *_rules(Grade.NOTED, "no part of the body", "BOUNDARY", case="of other nodes"),
    *_rules(
        Grade.LOST, "no part of the body, which a constraint may tie to it", "BOUNDARY", case="of tied other nodes"
    ),
    *_rules(Grade.TAKEN, "traction, force, gravity or rotation", "CLOAD", "DLOAD", "DSLOAD"),
    *_rules(Grade.LOST, "a part of the body", "DLOAD", case="body force or weight on a part"),
    *_rules(Grade.LOST, "moments at nodes", "CLOAD", case="components 4 to 6"),
    *_rules(Grade.LOST, "is no boundary of the body", "DSLOAD", case="on another surface"),
    *_rules(Grade.TAKEN, "temperature, body by body", "TEMPERATURE", "INITIAL CONDITIONS"),
    *_rules(Grade.LOST, UNKNOWN, "INITIAL CONDITIONS", case="neither TEMPERATURE nor VELOCITY"),
    *_rules(Grade.NOTED, WITHOUT_EFFECT, "INITIAL CONDITIONS", case="VELOCITY"),
    *_rules(Grade.TAKEN, "preload", "PRE-TENSION SECTION"),
    *_rules(Grade.TAKEN, "contact", "CONTACT PAIR", "SURFACE INTERACTION", "FRICTION", "SURFACE BEHAVIOR"),
    *_rules(Grade.LOST, SUBROUTINE, "SURFACE INTERACTION", case="USER"),
    *_rules(Grade.TAKEN, "friction that changes with the load step", "CHANGE FRICTION"),
    *_rules(Grade.NOTED, FRICTION_FIRST, "CHANGE FRICTION", case="beside loads or displacements of a later step"),
    *_rules(
        Grade.TAKEN, "contact pairs in the steps that have them; no elements that the first one removes", "MODEL CHANGE"
    ),
    *_rules(Grade.LOST, COMING_AND_GOING, "MODEL CHANGE", case="of elements in a later step, or of rigid surfaces"),
    *_rules(Grade.TAKEN, "distance of both surfaces, in place of that of the mesh", "CLEARANCE"),
    *_rules(Grade.LOST, NO_CLEARANCE, "CLEARANCE", case="of single nodes, or of no contact pair"),
    *_rules(Grade.LOST, OTHER_BEHAVIOUR, "CHANGE SURFACE BEHAVIOR"),
    *_rules(Grade.LOST, "here it is hard", "SURFACE BEHAVIOR", case="none of HARD, LINEAR, EXPONENTIAL, TABULAR, TIED"),
    *_rules(Grade.LOST, "contact that does not open again", "SURFACE BEHAVIOR", case="NO SEPARATION"),
    *_rules(Grade.LOST, "rough friction, which never slides", "FRICTION", case="ROUGH"),
    *_rules(Grade.LOST, "is no boundary of the body", "CONTACT PAIR", "TIE", case="of another surface"),
    *_rules(Grade.LOST, GENERAL_CONTACT, "CONTACT", "CONTACT INCLUSIONS"),
    *_rules(Grade.TAKEN, "bond", "TIE"),
    *_rules(Grade.TAKEN, "links of both sides of a sector, or contact with the next one", "CYCLIC SYMMETRY MODEL"),
    *_rules(
        Grade.LOST, UNTOUCHED_SECTOR, "CYCLIC SYMMETRY MODEL", case="CONTACT, without a contact pair of both sides"
    ),
    *_rules(Grade.LOST, NO_SECTORS, "TIE", case="CYCLIC SYMMETRY alone"),
    *_rules(Grade.TAKEN, "links between nodes", "EQUATION"),
    *_rules(Grade.TAKEN, "rigid foundation, or a bonded tool", "RIGID BODY"),
    *_rules(Grade.LOST, "a rigid part of the body: it deforms here", "RIGID BODY", case="of elements of the body"),
    *_rules(Grade.TAKEN, "a rigid tool that is bonded, or forces at nodes", "COUPLING", "KINEMATIC", "DISTRIBUTING"),
    *_rules(Grade.LOST, PARTLY, "KINEMATIC", case="without some displacements"),
    *_rules(Grade.LOST, CONSTRAINT, "COUPLING", case="of another surface"),
    *_rules(Grade.TAKEN, "links between nodes: PIN, TIE, PLANE, STRAIGHT", "MPC"),
    *_rules(Grade.LOST, CONSTRAINT, "MPC", case="of another type"),
    *_rules(Grade.LOST, CONSTRAINT, "DISTRIBUTING COUPLING"),
    *_rules(Grade.NOTED, WITHOUT_EFFECT, *_OTHER_PHYSICS),
    *_rules(Grade.TAKEN, "nothing: static steps do not need it", "MASS"),
    *_rules(Grade.TAKEN, "nothing: a result folder has all output", *_OUTPUT),
    *_rules(Grade.TAKEN, "tables of NAME.dat", "NODE PRINT", "CONTACT PRINT"),
    *_rules(Grade.TAKEN, "fields of NAME.frd", "NODE FILE", "EL FILE", "CONTACT FILE"),
    *_rules(Grade.NOTED, NOT_WRITTEN, "NODE PRINT", case="other than U, RF"),
    *_rules(Grade.NOTED, NOT_WRITTEN, "CONTACT PRINT", case="other than CDIS, CSTR"),
    *_rules(Grade.NOTED, NOT_WRITTEN, "NODE FILE", case="other than U, RF"),
    *_rules(Grade.NOTED, NOT_WRITTEN, "EL FILE", case="other than S"),
    *_rules(Grade.NOTED, NOT_WRITTEN, "EL PRINT", "FACE PRINT", "SECTION PRINT"),
    *_rules(Grade.NOTED, SECTOR, "NODE PRINT", "NODE FILE", case="RF of a body of revolution"),
)
# What a keyword is without any special case.
PLAIN = {rule.key: rule for rule in RULES if not rule.case}
