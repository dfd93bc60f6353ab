"""A result of another contact law than was asked for says so first: in the findings and in the summary."""

import numpy as np
import pytest
from scenes import alone, example1

from signorini_fx.mechanics.statement.settings import Accuracy, SolverSettings
from signorini_fx.results.certificate.certificate import Certificate
from signorini_fx.results.certificate.law_of_method import Law
from signorini_fx.results.requested_law import requested_law
from signorini_fx.results.summary import summary_of

LIMIT, REGULARISED = Law(), Law(1e8, 1e8)


def judged(laws, left=None, accuracy=None, **settings):
    """What is told of load steps with these laws."""
    certificates = {
        number: Certificate(law=law, penetration=1e-3 * number, stick_slip=2e-4)
        for number, law in enumerate(laws, start=1)
    }
    return requested_law(SolverSettings(**settings), certificates, left, raises_gamma=accuracy is not None)


@pytest.mark.parametrize(
    ("laws", "asked"),
    [
        ([LIMIT], {"algorithm": "alm"}),
        ([LIMIT], {"algorithm": "alm", "gamma_n": 1e8}),
        ([REGULARISED], {}),
        ([LIMIT], {}),
        ([REGULARISED], {"gamma_n": 1e8}),
        ([REGULARISED], {"gamma_n": 1e8, "gamma_t": 1e8, "algorithm": "continuation"}),
        ([Law(1e9, 1e9)], {"gamma_n": 1e8, "accuracy": Accuracy(target=0.1)}),
        ([REGULARISED], {"algorithm": "path-following", "regularisation_error": 1e-3, "left": 1e-3}),
        ([REGULARISED], {"algorithm": "path-following", "left": 1e-3}),
    ],
)
def test_what_was_asked_for(laws, asked):
    """Nothing is told."""
    assert judged(laws, **asked).differs == ""
    assert judged(laws, **asked).findings == []


@pytest.mark.parametrize(
    ("laws", "asked", "words"),
    [
        ([REGULARISED], {"algorithm": "alm"}, "'alm' was not reached, the regularised law with gamma_n = 1e+08"),
        ([LIMIT, REGULARISED], {"algorithm": "alm"}, "in load step 2"),
        ([REGULARISED, LIMIT, REGULARISED], {"algorithm": "alm"}, "in load steps 1, 3"),
        ([REGULARISED], {"algorithm": "alm", "left": 3e-3, "regularisation_error": 4.3e-5}, "4.3e-05 was asked for"),
        ([LIMIT], {"gamma_n": 1e8}, "a fall-back has solved the unregularised law in its place"),
        ([REGULARISED], {"gamma_t": 1e9}, "gamma_t = 1e+09 was asked for"),
        (
            [REGULARISED],
            {"algorithm": "path-following", "regularisation_error": 1e-4, "left": 1.1e-4},
            "a regularisation error of 0.0001 was asked for and 0.00011 is left",
        ),
    ],
)
def test_what_was_not(laws, asked, words):
    """It is told with what to do, as a warning."""
    told = judged(laws, **asked)
    assert words in told.differs
    assert told.differs.count(";") >= 1
    (finding,) = told.findings
    assert (finding.level, finding.message) == ("warning", told.differs)
    assert finding.path.startswith("solver.")


def test_error_that_the_path_does_not_reach():
    """The path in gamma ends at the largest gamma, converged, with a larger error than was asked for."""
    settings = {"algorithm": "path-following", "regularisation_error": 1e-13}
    solution = alone(example1(nx=12, ny=4, **settings), check=False)
    assert solution.converged
    assert solution.parameters["regularisation_error"] > 1e-13
    assert solution.findings[0].path == "solver.regularisation_error"
    law = summary_of(solution)["law"]
    assert law["differs"] == solution.findings[0].message
    reached = alone(example1(nx=12, ny=4, **settings | {"regularisation_error": 1e-2}), check=False)
    assert summary_of(reached)["law"]["differs"] == ""
    assert np.isfinite(reached.certificate.law.gamma_n)
