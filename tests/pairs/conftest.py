"""All pairs of these tests are integrated twice."""

import pytest
from paired_integrals import tried_by


@pytest.fixture(autouse=True)
def _integrated_twice(monkeypatch):
    tried_by(monkeypatch)
