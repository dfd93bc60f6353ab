"""The keywords of an Abaqus input file that a scene does not have, or has in part: the effect, and whether it changes
the answer.

The tests read a deck with each row of this table.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum


class Grade(StrEnum):
    """What it means for the answer that a keyword is not read."""

    NOTED = "does not change the answer"
    LOST = "changes the answer"
    REFUSED = "is an error"


@dataclass(frozen=True)
class Rule:
    """What becomes of a keyword.

    Attributes:
        keyword: as it is written, in capitals.
        case: with which parameter or data; empty: always.
        grade: whether the answer changes.
        effect: the remark, which names it.
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


UNKNOWN = "not read"
CONSTRAINT = "a constraint between nodes is not read"
COMING_AND_GOING = "parts and contacts that come or go are not read: all are there throughout"
CHANGED_WITHIN = "a change within a step is not read: the first value holds"
NOT_WRITTEN = "not written: nodes.csv and contact.csv of the result have all values"
NODES_DIFFER = "temperatures that differ within a body are not read"
WITHOUT_EFFECT = "without effect in static steps"
OTHER_PROCEDURE = "only static steps are read"
NO_PROCEDURE = "the step does not say of what kind it is: write *STATIC into it; CalculiX solves nothing in such a step"
AS_BEFORE = "as the step before it: this one does not say of what kind it is"
OUTSIDE_STEPS = "is expected within a step"
WITHIN_STEP = "is expected before the first step"
PERTURBATION = "PERTURBATION: contact may open and close here, and does not in such a step"
SMALL = "NLGEOM: displacements and rotations are taken as small"
PARTNERS = "NLGEOM: points in contact keep their partners"
TOTAL_TIME = "TIME=TOTAL TIME is read in decks of one step: the whole load is taken"
OTHER_AMPLITUDE = "only tabular amplitudes are read: the whole load is taken"
FIRST_LINE = "constants that depend on temperature: the first line is taken"
OTHER_RUBBER = "only NEO HOOKE, MOONEY-RIVLIN and OGDEN with D1 above 0 are read"
OTHER_HARDENING = "hardening that is not isotropic is not read: elastic here"
YIELDING_RUBBER = "a material with *HYPERELASTIC does not yield here"
OTHER_ELASTICITY = "only isotropic elasticity is read: state others in a scene, with material.orthotropic"
NOT_YET_NONLINEAR = "a nonlinear material is not possible yet"
BESIDE_RUBBER = "beside rubber: law = 'saint-venant-kirchhoff', linear in the strain of Green"
NO_SEPARATION = "NO SEPARATION is not read: this contact may open"
ROUGH = "ROUGH is not read: this contact has no friction"
OTHER_BEHAVIOUR = "soft contact is read as LINEAR or TIED only: this contact is hard"
ADJUSTED_SET = "ADJUST: a set with only some nodes of the dependent surface is not read"
NO_BOUNDARY = "is no boundary of the body"
NO_BODY_PART = "no part of the body"
IN_ANOTHER_SECTION = "some of its elements are in another section, too: give each of them one"
_MOMENTS = "moments at nodes are not read"

RULES: tuple[Rule, ...] = (
    *_rules(
        *(Grade.REFUSED, "nodes and elements are not generated here"),
        *("NGEN", "NFILL", "NCOPY", "NMAP", "ELGEN", "ELCOPY"),
    ),
    *_rules(Grade.REFUSED, "coordinates are expected along x, y and z", "SYSTEM", case="of other axes"),
    *_rules(Grade.REFUSED, "coordinates are expected along x, y and z", "NODE", case="SYSTEM other than R"),
    *_rules(Grade.REFUSED, OTHER_ELASTICITY, "ELASTIC", case="TYPE other than ISOTROPIC"),
    *_rules(Grade.NOTED, "without effect on isotropic materials", "ORIENTATION"),
    *_rules(Grade.REFUSED, OTHER_RUBBER, "HYPERELASTIC", case="another energy, or incompressible"),
    *_rules(Grade.REFUSED, NOT_YET_NONLINEAR, "HYPERELASTIC", case="with soft contact, preload, temperature and more"),
    *_rules(Grade.REFUSED, NO_PROCEDURE, "STEP", case="the first one without *STATIC"),
    *_rules(Grade.REFUSED, "has no *END STEP before this one", "STEP", case="within another one"),
    *_rules(
        *(Grade.REFUSED, OUTSIDE_STEPS, "STATIC", "CLOAD", "DLOAD", "DSLOAD", "TEMPERATURE"), case="outside of steps"
    ),
    *_rules(Grade.REFUSED, OUTSIDE_STEPS, "BOUNDARY", case="between steps"),
    *_rules(Grade.REFUSED, WITHIN_STEP, "INITIAL CONDITIONS", case="within a step"),
    *_rules(Grade.LOST, FIRST_LINE, "ELASTIC", "EXPANSION", case="several temperatures"),
    *_rules(Grade.LOST, CHANGED_WITHIN, "ELASTIC", "EXPANSION", "DENSITY", case="within a step"),
    *_rules(Grade.LOST, CHANGED_WITHIN, "HYPERELASTIC", "PLASTIC", case="within a step"),
    *_rules(Grade.LOST, CHANGED_WITHIN, "FRICTION", "SURFACE BEHAVIOR", case="within a step"),
    *_rules(Grade.LOST, CHANGED_WITHIN, "CHANGE FRICTION", "CHANGE SURFACE BEHAVIOR"),
    *_rules(Grade.LOST, OTHER_HARDENING, "PLASTIC", case="HARDENING other than ISOTROPIC"),
    *_rules(*(Grade.LOST, NOT_YET_NONLINEAR, "PLASTIC"), case="with soft contact, preload and more: it does not yield"),
    *_rules(Grade.LOST, YIELDING_RUBBER, "PLASTIC", case="of rubber"),
    *_rules(Grade.REFUSED, IN_ANOTHER_SECTION, "SOLID SECTION", case="of elements of another one"),
    *_rules(Grade.NOTED, BESIDE_RUBBER, "SOLID SECTION", case="beside rubber"),
    *_rules(
        *(Grade.NOTED, "as a plane body under plane stress, without bending", "SHELL SECTION", "MEMBRANE SECTION"),
        case="of a plane mesh",
    ),
    *_rules(Grade.LOST, NO_BODY_PART, "BEAM SECTION"),
    *_rules(Grade.LOST, NO_BODY_PART, "SHELL SECTION", "MEMBRANE SECTION", case="of no part of the mesh"),
    *_rules(Grade.LOST, NO_BODY_PART, "ELEMENT", case="springs, gaps, connectors"),
    *_rules(Grade.LOST, UNKNOWN, "GAP", "CONNECTOR FRICTION"),
    *_rules(Grade.LOST, "beside elements of another kind", "ELEMENT", case="CPE, CPS and CAX in one file"),
    *_rules(Grade.LOST, "rotated axes of nodes are not read", "TRANSFORM"),
    *_rules(Grade.NOTED, AS_BEFORE, "STEP", case="a later one without *STATIC"),
    *_rules(Grade.LOST, SMALL, "STEP", case="NLGEOM, if finite strains are not possible yet"),
    *_rules(Grade.LOST, PARTNERS, "STEP", case="NLGEOM, if solids of degree 2 touch, or with ADJUST"),
    *_rules(Grade.LOST, PERTURBATION, "STEP", case="PERTURBATION"),
    *_rules(
        *(Grade.LOST, OTHER_PROCEDURE, "FREQUENCY", "COMPLEX FREQUENCY", "BUCKLE", "DYNAMIC", "MODAL DYNAMIC"),
        *("STEADY STATE DYNAMICS", "STEADY STATE TRANSPORT", "HEAT TRANSFER", "VISCO", "GREEN", "CFD", "SENSITIVITY"),
        *("COUPLED TEMPERATURE-DISPLACEMENT", "UNCOUPLED TEMPERATURE-DISPLACEMENT", "COUPLED THERMAL-ELECTRICAL"),
        *("SUBSTRUCTURE GENERATE", "ANNEAL", "ELECTROMAGNETICS", "NO ANALYSIS", "RANDOM RESPONSE", "GEOSTATIC"),
        *("RESPONSE SPECTRUM", "SOILS", "MASS DIFFUSION", "DIRECT CYCLIC", "CRACK PROPAGATION", "ROBUST DESIGN"),
        "FEASIBLE DIRECTION",
    ),
    *_rules(Grade.LOST, OTHER_AMPLITUDE, "AMPLITUDE", case="DEFINITION other than TABULAR"),
    *_rules(Grade.LOST, TOTAL_TIME, "AMPLITUDE", case="TIME=TOTAL TIME, if there are more steps"),
    *_rules(Grade.NOTED, NO_BODY_PART, "BOUNDARY", case="of other nodes"),
    *_rules(Grade.LOST, "which a constraint may tie to it", "BOUNDARY", case="of tied other nodes"),
    *_rules(Grade.LOST, "a part of the body", "DLOAD", case="body force or weight on a part"),
    *_rules(Grade.LOST, _MOMENTS, "CLOAD", case="components 4 to 6"),
    *_rules(Grade.LOST, NO_BOUNDARY, "DSLOAD", case="on another surface"),
    *_rules(Grade.LOST, NODES_DIFFER, "TEMPERATURE", "INITIAL CONDITIONS", case="of some nodes of a body"),
    *_rules(Grade.LOST, UNKNOWN, "INITIAL CONDITIONS", case="neither TEMPERATURE nor VELOCITY"),
    *_rules(Grade.NOTED, WITHOUT_EFFECT, "INITIAL CONDITIONS", case="VELOCITY"),
    *_rules(Grade.LOST, "behaviour of a subroutine is not read", "SURFACE INTERACTION", case="USER"),
    *_rules(Grade.LOST, OTHER_BEHAVIOUR, "SURFACE BEHAVIOR", case="EXPONENTIAL, TABULAR and others"),
    *_rules(Grade.LOST, NO_SEPARATION, "SURFACE BEHAVIOR", case="NO SEPARATION"),
    *_rules(Grade.LOST, ROUGH, "FRICTION", case="ROUGH"),
    *_rules(Grade.LOST, ADJUSTED_SET, "CONTACT PAIR", case="ADJUST with a smaller set"),
    *_rules(Grade.LOST, NO_BOUNDARY, "CONTACT PAIR", "TIE", case="of another surface"),
    *_rules(Grade.LOST, "general contact is not read: name pairs of surfaces", "CONTACT", "CONTACT INCLUSIONS"),
    *_rules(Grade.LOST, "clearances are those of the mesh", "CLEARANCE"),
    *_rules(Grade.LOST, COMING_AND_GOING, "MODEL CHANGE"),
    *_rules(
        *(Grade.LOST, "rigid bodies are not read: give the shape as foundation of a contact, or its distance as gap"),
        "RIGID BODY",
    ),
    *_rules(
        *(Grade.LOST, CONSTRAINT, "EQUATION", "MPC", "COUPLING", "KINEMATIC", "DISTRIBUTING"),
        *("DISTRIBUTING COUPLING", "CYCLIC SYMMETRY MODEL"),
    ),
    *_rules(Grade.LOST, CONSTRAINT, "TIE", case="CYCLIC SYMMETRY"),
    *_rules(
        *(Grade.NOTED, WITHOUT_EFFECT, "CONDUCTIVITY", "SPECIFIC HEAT", "PHYSICAL CONSTANTS", "DAMPING"),
        *("GAP CONDUCTANCE", "GAP HEAT GENERATION", "CONTACT DAMPING", "DESIGN VARIABLES", "VIEW FACTOR", "CFLUX"),
        *("DFLUX", "FILM", "RADIATE", "EMISSIVITY"),
    ),
    *_rules(
        *(Grade.NOTED, NOT_WRITTEN, "NODE PRINT", "EL PRINT", "FACE PRINT", "SECTION PRINT", "CONTACT PRINT"),
        *("NODE FILE", "EL FILE", "CONTACT FILE"),
    ),
)
# The grade and effect of keywords that are never read.
NOT_READ = {rule.key: rule for rule in RULES if not rule.case}
# Requests for output, control of the solver, and masses, which a scene in static steps does not need.
OUTPUT = (
    *("PREPRINT", "RESTART", "OUTPUT", "NODE OUTPUT", "ELEMENT OUTPUT", "CONTACT OUTPUT", "FIELD OUTPUT"),
    *("HISTORY OUTPUT", "PRINT", "ENERGY OUTPUT", "ENERGY PRINT", "MONITOR", "FILE FORMAT", "CONTROLS"),
    *("HOURGLASS STIFFNESS", "TIME POINTS", "MASS"),
)
