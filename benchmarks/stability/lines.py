"""A plugin of pytest that writes the CPU time of each test, and the lines of the package that it runs.

    ./env python3 -m pytest -p benchmarks.stability.lines --lines FILE tests/...

Lines of modules and classes, which run when they are imported, do not count.
"""

from __future__ import annotations

import pickle
import resource
import sys
from collections.abc import Generator, Iterator
from pathlib import Path
from types import CodeType

import pytest

ROOT = Path(__file__).parents[2]
_PACKAGE = f"{ROOT}/"
_IN_A_FUNCTION = 1  # CO_OPTIMIZED

Line = tuple[str, int]


def pytest_addoption(parser: pytest.Parser) -> None:
    """Where to write."""
    parser.addoption("--lines", type=Path, metavar="FILE", required=True)


def pytest_configure(config: pytest.Config) -> None:
    """Begin to listen."""
    config.option.lines.unlink(missing_ok=True)
    config.pluginmanager.register(Recorder(config.option.lines))


class Recorder:
    """Writes one record for each test: its node, CPU seconds, new lines, and lines."""

    def __init__(self, file: Path) -> None:
        self._file = file
        self._number: dict[Line, int] = {}
        self._new: list[Line] = []
        self._run: set[int] = set()
        sys.monitoring.use_tool_id(sys.monitoring.COVERAGE_ID, "lines")
        sys.monitoring.register_callback(sys.monitoring.COVERAGE_ID, sys.monitoring.events.LINE, self._line)
        sys.monitoring.set_events(sys.monitoring.COVERAGE_ID, sys.monitoring.events.LINE)

    def _line(self, code: CodeType, line: int) -> object:
        if code.co_flags & _IN_A_FUNCTION and code.co_filename.startswith(f"{_PACKAGE}signorini_fx/"):
            key = code.co_filename.removeprefix(_PACKAGE), line
            if key not in self._number:
                self._number[key] = len(self._number)
                self._new.append(key)
            self._run.add(self._number[key])
        return sys.monitoring.DISABLE  # until the next test

    def pytest_unconfigure(self) -> None:
        """What the interpreter does at its end is no test."""
        sys.monitoring.register_callback(sys.monitoring.COVERAGE_ID, sys.monitoring.events.LINE, None)

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Generator[None, object, object]:
        """One test with its fixtures."""
        self._run.clear()
        sys.monitoring.restart_events()
        begin = _seconds()
        try:
            return (yield)
        finally:
            with self._file.open("ab") as stream:
                pickle.dump((item.nodeid, _seconds() - begin, self._new, sorted(self._run)), stream)
            self._new = []


def _seconds() -> float:
    every = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(usage.ru_utime + usage.ru_stime for usage in every)


def recorded(file: Path) -> Iterator[tuple[str, float, frozenset[Line]]]:
    """The tests of a file of records: node, CPU seconds, lines."""
    lines: list[Line] = []
    with file.open("rb") as stream:
        while True:
            try:
                node, seconds, new, run = pickle.load(stream)
            except EOFError:
                return
            lines += new
            yield node, seconds, frozenset(lines[k] for k in run)
