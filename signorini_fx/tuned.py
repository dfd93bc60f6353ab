"""Tuned constants: the meaning of each, and where it comes from.

Coefficients of a formula are in the formula, and the styles of lines where they are used.  No
constant here is a length, a stress or a time: each is a fraction, a factor, a power or a count,
except in the estimate of costs, which describes a machine, and where a unit is given.

*Choice* means that a value follows from reasoning alone; *no record* means that its source was not
recorded: whoever changes it has to measure. Unless stated otherwise a constant was tuned in 2D, on
Examples 1 and 2 of Kunisch & Stadler (2005) and Hertz's problem (``demos/scenes``), and on random
scenes (``demos/studies/random_scenes.py`` at 3c905269); those of Krylov methods were tuned in 3D.
"""

from __future__ import annotations

# --- gamma: the regularisation --------------------------------------------------------------------

# Natural gamma = this times E / size of the body: penetration is about 1e-5 of the displacements.
# Source: docs/theory.md, "γ"; docs/evidence/stability.csv of 75fb70cb.
AUTOMATIC_GAMMA = 1e5
# gamma above this times E / size loses the last digits of contact pressures.  Source:
# docs/evidence/stability.csv of 75fb70cb.
LARGEST_GAMMA = 1e9
# Path-following begins at this times E / size, where the penetration is a hundredth of the
# displacements.  Choice.
START_GAMMA = 100.0
# Continuation, and augmentation as a fall-back, begin at this fraction of the last gamma. Source:
# Table 4 of the paper.
CONTINUATION_SHARE = 1e-4
# The regularisation error of path-following, relative to the estimated discretisation error, by
# degree.
# Source: docs/evidence/effectivity.csv; with degree 2 the model of the path is wrong by a factor of
# two.
PATH_ERROR_SHARE = {1: 1.0, 2: 1 / 3}

# --- fall-backs and the augmented Lagrangian method -----------------------------------------------

# A load step with all fall-backs may take as many linear solves as this number of problems, each up
# to its limit of iterations. Choice.
PROBLEMS_PER_STEP = 40
# A load step of a ramp may take this many times the linear solves of the last solved one before a
# smaller increment is tried; the last attempt may take this many times more again. Choice.
FAILED_STEP = 3

# Factor by which gamma is increased from one problem to the next, by which both gammas may differ,
# and which gamma is at most over the stiffness at the contact nodes.  No record; see
# test_augmentation.py.
GAMMA_GROWTH = 10.0

# --- linear algebra and nested iteration ----------------------------------------------------------

# With fewer unknowns a factorisation costs no more than condensation. Source:
# docs/evidence/linear_algebra_in_space.csv of 75fb70cb.
FEWEST_CONDENSED_UNKNOWNS = 1_500
# Three dense matrices of this many unknowns take 0.6 GB, on each rank.
MOST_CONDENSED_UNKNOWNS = 5_000
# A nonlinear body in 3D is condensed onto the contact points that are closer to their shapes than
# this many times the largest expected motion; results do not depend on it. Source:
# docs/evidence/nonlinear_costs.csv of 5403cefd.
RETAINED_REACH = 0.5
# Number of unknowns from which on a Krylov method is used in 3D; the second if the system can be
# condensed. Source: docs/evidence/linear_algebra_in_space.csv of 75fb70cb.
FEWEST_KRYLOV_UNKNOWNS, FEWEST_KRYLOV_UNKNOWNS_IF_CONDENSED = 20_000, 40_000
# Number of unknowns from which on a body with a Krylov method is assembled by blocks, and a
# coarsest mesh is coarsened further by aggregation. Choice.
FEWEST_BLOCK_UNKNOWNS = 3_000
# Prefetch distance of the entries of blocks, bytes; between 1,100 and 7,200 times differ by a
# tenth.
PREFETCHED_BYTES = 3_600
# Poisson's ratio above which a factorisation is used: multigrid takes three times as many steps as
# for 0.4.
LARGEST_MULTIGRID_POISSON = 0.49
# Relative residual at which a Krylov solve ends while the active sets change. Source:
# docs/evidence/whole_solves_in_space.csv of 75fb70cb.
INEXACT_TOLERANCE = 0.03
# Largest number of steps of a Krylov method: ten times the largest observed. Choice.
KRYLOV_STEPS = 1000
# A mesh is a multigrid level for another mesh whose cells are smaller by a factor in this range.
# Choice.
FINER_LEVELS = (1.5, 3.0)

# A node is in the middle between two coarse ones if the farther is at most this times farther away.
# Choice.
MIDDLE_RATIO = 1.5

# --- error estimates ------------------------------------------------------------------------------

# The squared error of a linear interpolant is h^3 [p']^2 / 120 per node where p is smooth, and
# nearly four times that where it ends like a square root.  Tuned on the scenes of
# docs/evidence/effectivity.csv, within [0.5, 2].
KINK_SHARE = 1 / 33
# At a corner where the pressure is convex it is about this times h^3 [p']^2 in the last interval:
# of projected powers r^-a with a from 0.1 to 0.48 the estimate is 2.6 to 0.52 times the error.
CORNER_SHARE = 0.5
# Normals that turn by more than this (radians) from one interval to the next make a corner of the
# body.
CORNER_ANGLE = 0.4
# Share of the squared residual on the boundary, times h over the stiffness, that is added to the
# squared error.  Tuned on random scenes: with 0.05 and 0.1 some estimates were 0.63 and 0.67 of the
# error.
BOUNDARY_RESIDUAL_SHARE = 0.2
# The square of the error in the body, times about this, is its effect on the contact pressure: 6.5
# to 8 on locally divided meshes.
POLLUTION = 6.0
# The same factor for the largest pressure. Tuned on half disks and spheres
# (tests/accuracy/test_remade_meshes.py).
POLLUTION_OF_PEAK = 2.0
# Largest number of unknowns with which adjoint states of printed numbers are solved for; they take
# a few milliseconds.
MOST_ADJOINT_UNKNOWNS = 5_000
# --- convergence table: errors and costs from mesh to mesh ----------------------------------------

# How errors decrease with h; the ends of the contact zone limit all but the peak.  Tuned on Example
# 1; observed rates scatter too much.
EXPECTED_RATES = {"pressure": 1.25, "force": 2.0, "zone": 1.0, "peak": 1.5}
# The rate of the displacement is the observed one, within these limits.  Choice.
ENERGY_RATES = (0.5, 2.0)
# Number of previous changes between meshes that an estimate uses.  Choice.
CHANGES_USED = 3
# The error that a polygon causes in each quantity, over ``LevelResult.polygon``; that of forces is
# the square of that of the pressure.  Tuned on a round lip pressed onto a plane, with 1 to 39 nodes
# in contact.
POLYGON_SHARES = {"energy": 0.04, "pressure": 0.15, "peak": 0.5}
# The error of a force over the squared one of the displacement, at least, on divided meshes.  In 3D
# 0.09 to 0.29.
FORCE_OF_ENERGY = 0.12
# The largest pressure has no limit if it grows like h^-GROWTH_POWER or faster on GROWING_MESHES
# successive meshes, and the last power of growth is above LASTING_SHARE times the first. Fixed on
# random scenes.
GROWING_MESHES = 2
GROWTH_POWER = 0.05
LASTING_SHARE = 0.6
# An error that decreases by less than this from mesh to mesh is taken not to decrease at all.
# Choice.
SLOWEST_DECREASE = 0.95
# Powers of the unknowns that time and memory of factors grow with.  Tuned on
# docs/evidence/prediction.csv of 75fb70cb.
TIME_POWER = {2: 1.2, 3: 1.6}
MEMORY_POWER = {2: 1.1, 3: 1.3}
# At least this fraction of the time is assumed to grow with the unknowns: the previous mesh may
# have had a cold start. Tuned on the same file.
LEAST_GROWING_TIME = 0.25
# Factor of the error for which the cost is forecast. Choice.
NEXT_ERROR = {2: 0.1, 3: 1 / 3}
# Power of h with which the error of the stress decreases under uniform refinement. Source:
# docs/evidence/forecasts.csv at 05d7b176: 0.69 to 0.91 in 3D; rubber and metal in 2D: 0.72 to 1.04.
UNIFORM_RATE = 0.8
# Fixed cost of a solve, as a number of additional unknowns, by dimension. Tuned like the next three
# on 46 runs of 36 problems of demos/studies/forecast_problems.py (f2e60129).
FIXED_UNKNOWNS = {2: 2300.0, 3: 400.0}
# Adaptively divided meshes: unknowns of the first one; growth from each to the next; and, by
# dimension, unknowns of the adaptive mesh with the error of a uniform one, over the square root of
# the unknowns of the uniform one.
FIRST_UNKNOWNS, LOCAL_GROWTH = 300.0, 1.7
LAST_UNKNOWNS = {2: 14.0, 3: 38.0}
# Time of all intermediate meshes over the time of their solves. Tuned on the problems of
# docs/evidence/forecasts.csv at 05d7b176.
MESHES_TIMES = 1.8
# Factors within which forecast times are known, the first for adaptive division in 2D: see
# docs/evidence/forecasts.csv.
LOCAL_SPREAD, UNIFORM_SPREAD = 2.0, 3.1
# --- solution to a given accuracy -----------------------------------------------------------------

# Generated meshes begin with cells larger than those of the scene by this factor, by degree.
# Choice.
COARSER_START = {1: 4, 2: 8}
# Safety factors of error estimates; the second, by degree, for the displacement. Source:
# docs/evidence/effectivity.csv, where estimates over errors are 0.79 to 1.14 for the displacement
# and 0.50 to 1.85 for the pressure.
MARGIN = 2.0
MARGIN_OF_ENERGY = {1: 1.7, 2: 1.4}
# Fraction of the allowed error that the regularisation may cause. Choice.
REGULARISATION_SHARE = 0.2
# Largest refinement from one mesh to the next, by dimension, and the smallest one if errors are
# estimated by comparing meshes. No record.
LARGEST_JUMP = {2: 4.0, 3: 2.0}
SMALLEST_JUMP = 1.5
# Range of the Doerfler fraction: the part of the squared error that is refined. No record.
BULK = (0.5, 0.75)

# --- check: what a solve will cost ----------------------------------------------------------------

# Range of linear solves of one load step per log2 of the number of contact nodes; twice as many if
# friction depends on the pressure.  Tuned on a sweep over Example 1 with 25 to 241 contact
# nodes.
SOLVES_PER_DOUBLING = (0.7, 3.0)
# Range of linear solves that start from the active sets of the previous load step or of the coarser
# mesh. No record.
SOLVES_OF_START = (2, 5)
# By dimension: entries of a sparse factor over n log2 n (3D: n^(4/3)), and seconds of its
# factorisation over n^1.5 (3D: n^2); seconds of the rest of a solve over n. Tuned with CHOLMOD and
# MUMPS on one core; see test_cost_model.py.
FACTOR_ENTRIES = {2: 5.0, 3: 9.0}
FACTOR_SECONDS = {2: 3e-9, 3: 4e-10}
SOLVE_SECONDS = 1e-6
# Dense Cholesky, operations a second.  No record.
DENSE_SPEED = 2e10
# Seconds of a load step per unknown, by dimension, if factorisations do not dominate; the fixed
# cost is in ``FIXED_UNKNOWNS``.  Tuned on 49 scenes: 8.5 to 14 and 66 to 76 times 1e-6.
WHOLE_SECONDS = {2: 1.2e-5, 3: 7e-5}
# Bytes of a process without a mesh, and the least bytes of mesh, forms and vectors per unknown. No
# record.
BASE_BYTES, BYTES_PER_DOF = 1.4e8, 1.0e3
# Additional bytes for each contact node between bodies, by dimension. Source: peak memory of solves
# with 1,764 to 40,804 of them, in 2D with 1,502.
PAIRED_BYTES = {2: 1.7e4, 3: 2.0e5}
# Share of the machine's memory above which check warns, and no finer mesh is begun.  Choice.
MEMORY_SHARE = 0.8

# --- load steps -----------------------------------------------------------------------------------

# A load step of a ramp is easy if it takes at most this many linear solves; near the limit it takes
# 15 and more. Two easy steps double the increment, up to LARGEST_INCREMENT times the requested one.
EASY_STEP = 12
LARGEST_INCREMENT = 2.0
# A ramp gives up once its increment is at most this fraction of the load since the last factor, or,
# if no step was solved, the second fraction of the requested increment.
ENCLOSED = 0.005
SMALLEST_INCREMENT = 1e-5

# --- tolerances for round-off ---------------------------------------------------------------------

# A share whose square is round-off: components of unit vectors along a direction that they do not
# have, distances of places that are one, over the size of the body, resistance to a motion that
# nothing holds.  Choice.
ROOT_OF_EPS = 1e-8
# Round-off of assemblies, linear solves and sums over a mesh where the result should vanish,
# relative to the largest term or the forces. Choice: ten times that of direct solves;
# docs/evidence/whole_solves_in_space.csv of 75fb70cb.
LEFT_BY_SOLVES = 1e-11
# A fraction that is not visible in three digits. Choice.
NEGLIGIBLE = 1e-3
# A fraction that is notable in a result: strains, rotations and displacements that linear
# elasticity neglects, facets off a curve, forces beyond the end of a side. Choice.
NOTABLE = 0.1

# Components of a unit vector and entries of a projection below this are round-off, without a sum.
# Choice: 45 units.
ZERO_COMPONENT = 1e-14
# Numbers that differ by less than this share of their size are equal, and sums, components and
# sines below this share of their terms are zero.  Choice: a thousand units of round-off for each of
# a few terms.
SAME_NUMBER = 1e-12
# Lengths and distances, as shares of the size of the body, the facet or the edge that they belong
# to, and places on a load path, that are equal although they were computed in different ways.
# Choice.
SAME_LENGTH = 1e-9
# Results of a solution (forces, pressures, displacements, normals of facets) below this fraction of
# the largest one are round-off. Choice: solves leave up to 1e-10 of the forces.
ZERO_IN_SOLUTION = 1e-9

# Results of a projection, an assembly or an elimination below this fraction of the largest one are
# round-off: entries, pivots and eigenvalues of matrices, parts of facets and cells, motions and
# loads. Choice.
NOTHING_LEFT = 1e-10
# Forces are round-off below this fraction of all loads, of stiffness times displacement, or of the
# forces on the largest piece; Newton's method ends at a residual of this size. Choice.
NO_FORCE = 1e-8
# Points of drawings and files coincide, faces are plane and directions parallel within this
# fraction of their size, or this angle in radians. Choice: single precision.
DIGITS_OF_FILES = 1e-6
# Numbers of a scene must lie between the inverse of this and this, in any units; otherwise energies
# and forces overflow. Choice.
LARGEST_NUMBER = 1e60

# Largest number of steps of iterations that usually end much earlier: Newton's method and
# projections for points on curves and in cells, for balances and for chi, and meshes to an
# accuracy. Choice.
MANY_STEPS = 50

# --- algorithms -----------------------------------------------------------------------------------

# The interior-point method is used to find sets after SLOW_STEPS full steps if the sets do not
# settle: in the last three steps the contact set has changed its size, at least ``DECIDED`` times
# as many points have changed as in the three before, and more than SLOWEST_STEPS full steps are
# expected; otherwise after SLOWEST_STEPS. Tuned on 400 random compact problems.
SLOW_STEPS, SLOWEST_STEPS = 7, 25
# It proposes sets once its complementarity products are NEGLIGIBLE beside the first ones, a step
# has at least this length, and the set of at most one point still changes.
DECIDED = 0.7
# Residuals are measured relative to forces that are at least this fraction of stiffness times
# displacement, so that NO_FORCE times these is above round-off. Choice.
ATTAINABLE_SHARE = 1e-7

# --- assembly, contact boundaries and supports ----------------------------------------------------

# Two bodies are equally stiff, and their facets equally large, within these ratios. No record.
STIFFER_BODY, COARSER_FACETS = 2.0, 1.25
# Nodes of a finer mesh may be outside the coarser one by this fraction of a cell, because of curved
# boundaries. Choice.
OUTSIDE_COARSER_MESH = 0.25
# Largest component across a plane of symmetry of the mean normal over one half of a smooth surface.
# Choice.
ASKEW_NORMAL = 0.2
# Poisson's ratio above which fully integrated elements lock visibly, and check warns. Choice.
LOCKING_POISSON = 0.45

# --- statics, limit loads and sections with a preload ---------------------------------------------

# Contact forces above this many times the loads are not accepted as a balance; a Coulomb
# coefficient above it counts as unlimited. Choice.
LARGEST_BALANCING_FORCE = 1e4
# A preloaded section that carries less than its force divided by this is shortened at most by this
# factor at a time. No record.
SHORTENED_AT_MOST = 30.0

# --- bounds of the error --------------------------------------------------------------------------

# Number of parts along each edge of a facet for tractions between non-matching facets. Tuned on
# random scenes of two bodies in 3D.
PARTS_OF_EDGE = 3
# Round-off of forms per unit of eps, of the ratio of the moduli, and of the fourth power of the
# condition of a tetrahedron.  Source: tests/bounds/test_lifted_tractions.py at 730724ff: those of
# turned ones differ by a third of this at most.
ROUNDED_FORMS = 1e3

# --- check and drafts: thresholds of warnings -----------------------------------------------------

# A gap is far if it is this many times larger than prescribed displacements; a stress above this
# many times the yield stress is not printed in per cent. Choice.
FAR_GAP = 10.0
# Contact stiffer than this times E over the size of the body is hard to four digits, which a draft
# reports. Choice.
HARD_CONTACT = 1e4
# --- derivatives and friction laws of users -------------------------------------------------------

# Change of a datum for a difference of residuals, relative to it or to its natural unit; strain for
# a difference of energies; share of displacement and tractions for one of a quantity, and of the
# size of the body for one of distances. Choice: the cube root of the unit of round-off is best for
# central differences.
DIFFERENCE_STEP = 1e-5
# Differences by Constants of forms: the largest half width, and the number of widths from which the
# limit is extrapolated. Choice: smooth data converge after three to five widths; narrow differences
# of slender bodies are wrong by 1e-5 to 7e-4.
WIDEST_DIFFERENCE, WIDTHS_OF_DIFFERENCE = 1e-2, 6
# Largest magnification of a displacement that is left out: it is drawn in true size. Choice.
SEEN_AS_IT_IS = 2.5
# What a law of a user's own says of itself is tried at about so many of its points, from this power
# of ten of the modulus up to the modulus, at so many pressures in each decade.  It may be wrong by
# the last share, and by so much less a distance of a shape may grow along its normals.  Choice.
TRIED_POINTS = 50
SMALLEST_PRESSURE = -9
PRESSURES_PER_DECADE = 32
WRONG_SLOPE = 1e-2

# --- limits of time and memory --------------------------------------------------------------------

# Seconds that a rank with an error waits for the others. Choice.
ERROR_PATIENCE = 30.0
# Seconds between two changes of progress, two attempts to get a lock, and until the first rank ends
# another.  Choice.
PROGRESS_PAUSE = 0.2
# --- meshes and points in them --------------------------------------------------------------------

# Growth of the cell size per distance from facets of a given size. Choice.
SIZE_GROWTH = 0.25
# Smallest cell size of a remade mesh, relative to that of the last mesh at the same place. Choice.
SHORTEST_CHILD = 0.25
# Largest median facet length over the requested size. Choice: longest edges of gmsh are 1.2 times.
LONGEST_FACET = 1.4
# A point outside the hull of a table is moved towards its middle by this share: curved boundaries.
# Choice.
OUTSIDE_HULL = 0.02

# --- contact between two bodies -------------------------------------------------------------------

# Fraction of the size of a side by which bodies may overlap, and by which facets may be farther
# apart than the smallest distance. Choice.
DEEPEST_OVERLAP = 0.2
# Surfaces of two bodies are proposed for contact if their distance is below the first fraction of a
# facet, and they face each other over more than the second fraction of the smaller one. Source:
# four assemblies, tests/mesh/test_proposals.py.
NEAR_BODIES, LEAST_PAIR = 0.25, 0.01
# Fraction of its weight that a dual shape function must keep to carry a contact point. No record.
KEPT_WEIGHT = 0.03
# Fraction of its weight from which on a dual shape function of sliding sides is used unchanged:
# below it changes smoothly into a mean of its neighbours, which is reached at KEPT_WEIGHT. Choice.
WHOLE_WEIGHT = 0.15
# Two sides face each other if the product of their normals is below this. Choice: 102 degrees.
FACING_SIDES = -0.2
# How many facets points of two nonlinear bodies that keep their partners may move along the other
# side without a warning.  Choice: forces of blocks with some facets over the contact were off by 9
# % after one.
FACETS_OF_KEPT_PARTNERS = 0.5

# --- certificate and statements on results --------------------------------------------------------

# The certificate fails if a violation exceeds this fraction of the solution's own scale; smaller
# gaps, motions, forces and vectors count as zero, and points this close to the border of two active
# sets count as being on it. No record.
CERTIFICATE_TOLERANCE = 1e-6
# With fewer nodes in contact neither the ends of the zone nor the largest pressure are reliable.
# No record.
FEW_NODES = 8
# Round-off of the evaluation of nodal forces, in units in the last place of displacements and
# loads. Choice.
LOST_UNITS = 100.0
# Round-off of distances and sides, in units in the last place of the largest coordinate. Choice:
# two were observed.
UNITS_OF_PLACES = 10.0
# A boundary is closed if the sum of its normals, by their areas, is a smaller share of its area.
# Choice.
CLOSED_BOUNDARY = 0.01
# Angles within a body that differ by less than these degrees are equal.  Choice.
SAME_ANGLE = 1.0

# --- pictures: sizes and when a thing is drawn ----------------------------------------------------

# Choices by eye, on the pictures of demos/scenes.
# Width over height from which on a picture of a report is not made smaller than it can be read.
BROAD_PICTURE = 1.6
# Width and height of a body at most, and of the narrowest picture, for its lettering, inches.
BODY_INCHES, NARROWEST = 4.8, 3.4
# How far a foundation is drawn beside the body, over the longest side of the body; number of grid
# lines along that side, in 2D and in 3D; a round foundation whose diameter is at most the last
# fraction of that side is drawn whole.
FOUNDATION_BESIDE = 0.25
FOUNDATION_GRID = 300
FOUNDATION_GRID_IN_SPACE = 40
WHOLE_FOUNDATION = 0.7
# Margin around a contact boundary, over its longer side.
SURFACE_MARGIN = 0.08
# If the surroundings of the contact are less than this share of a boundary, only they are drawn;
# contact on less than this share of the diagonal of the body is enlarged.
SMALL_PART, SMALL_ZONE = 0.5, 0.2
# Length of a mean normal below which a boundary is drawn as a closed one.
CLOSED_IN_PICTURE = 0.3
# Sizes from which on the edges of a cell in 2D and of a facet in 3D are drawn, in 1/72 inch.
VISIBLE_CELL, VISIBLE_FACET = 5.0, 9.0
# Length of the longest arrow, over the longer side: of a contact surface, of a set-up.  A load of
# less than the last share of the largest one has no arrow; arrows along the boundary are so far
# beside the body, over its size.
LONGEST_ARROW = 0.06
LONGEST_ARROW_OF_SETUP = 0.13
SMALLEST_ARROW = 0.02
# How far arrows are around the picture of a body, over its longer side.
ARROWS_AROUND = 0.05
# At most so many arrows or supports, and strokes, along the larger side of a picture.
MOST_ARROWS, MOST_STROKES = 22.0, 50.0
# Colours are so far in front of the body, over its size.
COLOURS_ABOVE = 5e-4
# Share of the light that comes from everywhere; the rest comes from the viewer.
AMBIENT_LIGHT = 0.5
# Facets that turn by more than these degrees meet in an edge; a foundation whose direction the
# magnified gap turns by more is another one.
SHARP_EDGE = 40.0
# How much more of the field another view must show to be preferred to the usual one.
PREFERRED_GAIN = 1.15
# Fraction of the area that sets the range of colours; the rest gets the extreme ones.
USUAL_COLOURS = 0.99
# Above this cosine a direction is taken for that of the nearest coordinate axis.
ALONG_AXIS = 0.99

# --- nonlinear bodies -----------------------------------------------------------------------------

# The tangent is kept after an increment below these fractions of the largest displacement and of
# the last increment. Choice.
KEPT_TANGENT = 3e-5, 0.1
# Fraction of the initial slope up to which an increment is accepted.  Source: a disc with J2
# plasticity.
WHOLE_SLOPE = 0.5
# Largest number of halvings in a line search. Choice.
LINE_SEARCH_STEPS = 12
# Range of linear solves of a load step of a nonlinear body: rubber and metal, with and without
# friction.
NEWTON_SOLVES = (5, 18)
# A ramp doubles the increment after a step with at most this many iterations. Choice.
FEW_NEWTON_ITERATIONS = 6
# Lower bound of the relative change of a slip by the rotation of its tangent plane, in hollow
# shapes. Choice.
MOST_TURNED = -0.5
# Below this relative difference of two squared stretches a series replaces their powers. Choice,
# from the errors of both.
EQUAL_STRETCHES = 0.01
# Below this distance from one a series replaces powers and logarithms minus their tangents. Choice,
# as above.
NEAR_ONE = 1e-3
# Stiffness that holds contact points for the inertia of a tangent, over its largest diagonal entry.
# Choice.
HOLDING_STIFFNESS = 1e4
# A tangent is tested by differences of the residual over these strains. It is the derivative if,
# over one of them, both differ by less than SAME_TANGENT, relative to the norm. Choice: the first
# strain is far below the yield strain of metals; the second is for a cell so close to its yield
# stress that the first one crosses it.
DIFFERENCE_STRAINS = (1e-7, 1e-9)
SAME_TANGENT = 1e-6
# Forces up to this many times the round-off of a residual are no load: at rest they are about one.
# Choice.
UNITS_OF_NO_LOAD = 4.0
# The strain, in units of round-off, over which a second difference of a residual is round-off.
# Choice.
UNITS_OF_DIFFERENCE = 500.0
# A shape lies inside the body if it penetrates by more than this fraction of the radius of a cell
# and of the largest ball in the shape; its motion is checked in increments of half of that. Choice:
# a chord between two nodes cuts a circle whose radius is six tenths of its length to less than
# that.
SHAPE_INSIDE = 0.5
# Largest number of checked positions during a motion. Choice: each takes a search of all cells.
MOST_PLACES = 400
# Cosines of angles at a corner of a foundation: a node of the facet that it presses on has a
# contact point of its own if its direction is within the first one of that of its facets, and a
# facet goes on behind a vertex that turns by less than the second one.  Choice: 30 and 45 degrees;
# of a hook that slides over a corner 45 and 30 give the same, 60 a false wall.
ALONG_FACET, BEYOND_FACET = 0.866, 0.707
# Coordinates along a facet, 0 to 1 on it, within which it is prolonged for a second point.  Choice:
# a foot on the nearer half of one facet is half a facet beyond the other, if both are as long.
PROLONGED_FACET = -0.6, 1.6
# Points along each axis of the grid on which the middle of the largest ball is sought: an odd
# number.  Choice.
INRADIUS_GRID = 9
# Share of the radius of the largest ball in a rigid shape at which its middle is.  Choice.
SHAPE_MIDDLE = 0.9

# --- judge: thresholds for results of other programs ----------------------------------------------

# Nodes of a result are those of the problem up to this share of its size: print of six digits.
JUDGED_SAME_PLACE = 1e-5
# Number of printed digits that are needed: three leave 1e-2 of the energy norm. Times have as many.
JUDGED_DIGITS = 4
# Decimal exponent from which on a factor is taken for another unit: a thousand is, tested loads and
# moduli are not.
JUDGED_UNITS = 2.5
# Largest number of unknowns of a finer mesh that is solved for the error on the mesh of a result:
# half a minute in 3D.
JUDGED_FINEST = 60_000
# Largest number of increments with friction that are solved, and of values of a number that are
# tested. Choice: CalculiX takes ten at most.
JUDGED_INCREMENTS = 8
# Another problem explains a result if at most this fraction of the distance remains; ``NOTABLE`` if
# the distance is within the error of the mesh. Of 34 good results the best leaves .56.
JUDGED_LEFT = 0.45
