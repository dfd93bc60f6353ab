"""Sets of parameters of tests."""

import pytest


def slow(*values, **options):
    """A set that is slow."""
    return pytest.param(*values, **options, marks=pytest.mark.slow)
