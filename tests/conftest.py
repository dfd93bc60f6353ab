"""One report for all ranks: rank 0 prints it, a failure on any rank is a failure on all, and none
waits for ever.
"""

from __future__ import annotations

import faulthandler
import functools
import gc
import io
import os
import signal
import sys
import time

# Read where MPI starts: ranks that wait let others have the core.
os.environ.setdefault("OMPI_MCA_mpi_yield_when_idle", "1")

if (
    (3, 13) <= sys.version_info < (3, 13, 3)
):  # where a method that is chosen by a type keeps meshes of UFL for ever
    functools.singledispatchmethod.__set_name__ = lambda method, *_: setattr(
        method, "_method_cache", None
    )

from mpi4py import MPI  # first, see signorini_fx.mechanics.body

# isort: split
import pytest
from _pytest.config import create_terminal_writer
from _pytest.faulthandler import fault_handler_stderr_fd_key
from dolfinx import jit
from hypothesis import given, settings
from hypothesis.strategies import none

if os.environ.get("SFX_WITHOUT_ADD_ONS"):
    pytest_plugins = ["without_add_ons"]

# A shell ignores Ctrl-C in what it starts in the background; programs hand that on to those that
# the tests interrupt.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

# The report's own communicator: its messages never meet those of a test.
COMM = MPI.COMM_WORLD.Dup()
PATIENCE = (
    120.0  # seconds that a rank waits for the others at the end of a test before it ends them all
)
LIMIT = (
    1800.0  # seconds after which a test on several ranks is taken to hang, on a busy machine too
)

# Where tests run side by side, one process may wait for the other one's compiler.
jit.DOLFINX_DEFAULT_JIT_OPTIONS["timeout"] = (int(PATIENCE), "seconds")

# Every rank must draw the same examples, on every run.
settings.register_profile("exact", derandomize=True, database=None, deadline=None)
settings.load_profile("exact")


@pytest.hookimpl(trylast=True)
def pytest_configure(config):
    """Silence the report of all ranks but the first."""
    if COMM.rank > 0:
        reporter = config.pluginmanager.get_plugin("terminalreporter")
        reporter._tw = create_terminal_writer(config, io.StringIO())


@pytest.hookimpl(trylast=True)
def pytest_generate_tests(metafunc):
    """Parametrise a function by the arguments of its mark ``one_quick``, if it has any."""
    for mark in metafunc.definition.iter_markers("one_quick"):
        if mark.args:
            metafunc.parametrize(*mark.args, **mark.kwargs)


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items):
    """Of a function marked ``one_quick``, and on several ranks of every function, the first set of
    parameters that is not slow is quick, and the others are slow.
    """
    quick = set()
    for item in items:
        function = item.nodeid.partition("[")[0]
        on_ranks = item.get_closest_marker("mpi") if COMM.size > 1 else None
        one_alone = on_ranks is not None or item.get_closest_marker("one_quick") is not None
        if (one_alone and function in quick) or (
            on_ranks is not None and on_ranks.kwargs.get("slow")
        ):
            item.add_marker("slow")
        elif not item.get_closest_marker("slow"):
            quick.add(function)
    # Side by side, what takes long must not begin last, when nothing is left for the others.
    items.sort(key=lambda item: item.path.name != "test_verification.py")


def pytest_collection_finish():
    """The garbage collector need not visit libraries and tests, most of all objects that there are,
    again and again.
    """
    given(none())(
        lambda _: None
    )()  # hypothesis makes its generator of random numbers, and asks the collector who has it
    gc.collect()
    gc.freeze()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item, nextitem):
    """Where a test hangs inside MPI, PETSc or dolfinx, neither a signal nor another Python thread
    is served: a thread of faulthandler, which needs no interpreter, shows where each rank is and
    ends it; mpirun then ends the others.
    """
    if COMM.size > 1:
        shown = item.config.stash[fault_handler_stderr_fd_key]
        faulthandler.dump_traceback_later(LIMIT, exit=True, file=shown)
    try:
        return (yield)
    finally:
        faulthandler.cancel_dump_traceback_later()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item, call):
    """Let all ranks agree on the outcome of each phase of each test."""
    report = yield
    if COMM.size > 1:
        mine = f"on rank {COMM.rank}: {report.longreprtext}" if report.failed else ""
        failures = [failure for failure in gather(mine, report.nodeid) if failure]
        if failures:
            report.outcome, report.longrepr = "failed", "\n\n".join(failures)
    return report


def gather(text, name):
    """The texts of all ranks; if one of them does not come, it is stuck in the test, and all are
    ended.
    """
    request = COMM.Ibarrier()
    deadline = time.monotonic() + PATIENCE
    while not request.Test():
        if time.monotonic() > deadline:
            print(
                f"{name}: rank {COMM.rank} waits in vain for the others\n{text}",
                file=sys.__stderr__,
                flush=True,
            )
            MPI.COMM_WORLD.Abort(1)
        time.sleep(0.001)
    return COMM.allgather(text)
