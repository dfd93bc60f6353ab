"""The tests where no add-on is installed (``make test-core``): those that ask for one are skipped, all others pass."""

import sys

import pytest

from signorini_fx.errors import InstallationError

# Meshes come from generators in nearly all tests.
ROOMS = ("bounds", "decks", "derivatives", "judging", "pictures", "report")
sys.modules |= {f"signorini_fx.addons.{room}": None for room in ROOMS}  # to import one of them is an error
ABSENT = ("No module named 'signorini_fx.", "halted; None in sys.modules", "an add-on that is not installed")


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report(collector):
    """Leave out a file of tests that imports an add-on."""
    report = yield
    if report.failed and any(absent in str(report.longrepr) for absent in ABSENT):
        report.outcome, report.result, report.longrepr = "passed", [], None
    return report


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item, call):
    """Skip what imports or asks for an add-on."""
    report = yield
    if call.excinfo is not None and call.excinfo.errisinstance((ImportError, InstallationError)):
        reason = str(call.excinfo.value)
        report.outcome = "skipped" if any(absent in reason for absent in ABSENT) else report.outcome
        report.longrepr = report.longrepr if report.outcome != "skipped" else (str(item.path), 0, reason)
    return report
