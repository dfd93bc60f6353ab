"""Random nonlinear bodies: none is called converged that another program finds wrong, and that program sees faults."""

import sys
from pathlib import Path

import numpy as np
import pytest

from signorini_fx.records import Status

sys.path.insert(0, str(Path(__file__).parents[2]))

from benchmarks.stability.nonlinear_bodies import RandomBody, posed, tried

DRAWN = [RandomBody.drawn(seed) for seed in range(300)]


@pytest.mark.one_quick
@pytest.mark.parametrize(
    ("seed", "expected"),
    [
        (8, Status.CONVERGED),
        (11, Status.CONVERGED),
        (13, Status.CONVERGED),
        (16, Status.INSIDE),  # through the body in one step
        (21, Status.INSIDE),  # between two nodes
        (74, Status.INSIDE),  # to its middle
        (4, Status.CONVERGED),  # with a tangent that is damped
    ],
)
def test_quick_ones(seed, expected):
    """What is converged is so for the judge; the others end by name."""
    end, faults = tried(seed)
    assert faults == []
    assert end == expected.value


def test_the_judge_sees_what_is_wrong():
    """A circle between nodes, one that has gone through, a force without contact."""
    body = next(b for b in DRAWN if not b.pressure and not b.friction and not b.pull.any())
    _, judge = posed(body)
    still = np.zeros_like(judge.x)
    width, height = body.size
    beside = np.array([-2 * body.radius - width, height / 2])
    assert judge.faults(still, beside) == []
    assert "circle inside the body" in judge.faults(still, np.array([0.51 * width, 0.52 * height]))
    assert judge.passed((still, beside), (still, beside + np.array([4 * body.radius + 3 * width, 0.0])))
    moved = still.copy()
    moved[np.argmax(judge.x[:, 1])] = 0.01 * height
    assert any("without contact" in fault for fault in judge.faults(moved, beside))
