"""Copies of the checkout in which tests run, with compiled forms of their own, under limits of time and memory."""

from __future__ import annotations

import contextlib
import os
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path

ROOT = Path(__file__).parents[2]
# CPU seconds of a process, and wall seconds, by how much is run: a mutant may run endlessly.
_LIMITS = {"files": (600, 2400), "suite": (3600, 7200)}
_MEMORY = 16_000_000  # kB of address space


class Copy:
    """A copy of the checkout.

    Args:
        folder: an empty folder.
        cache: of compiled forms.
        source: what to copy: the checkout, or a copy of it, whose bytecode spares mutants most of theirs.
    """

    def __init__(self, folder: Path, cache: Path, source: Path = ROOT) -> None:
        self.folder, self.cache = folder, folder / "cache"
        self._first = source == ROOT
        (folder / "tmp").mkdir()
        bytecode = ("__pycache__",) if self._first else ()
        anywhere = shutil.ignore_patterns(".git", ".*_cache", ".hypothesis", *bytecode)

        def ignored(place: str, names: list[str]) -> set[str]:
            """Files that are not in git; the package has a folder of the same name as that of the results."""
            return anywhere(place, names) | ({"results", "build"} & set(names) if Path(place) == source else set())

        shutil.copytree(source, folder / "code", symlinks=True, ignore=ignored)
        # Compilation locks of another mutant that ended would make this one wait.
        for name in ("fenics", "matplotlib"):
            if (cache / name).is_dir():
                shutil.copytree(cache / name, self.cache / name, copy_function=_link)

    @property
    def code(self) -> Path:
        """The checkout."""
        return self.folder / "code"

    def pytest(self, arguments: Sequence[str], limit: str) -> tuple[int | None, str]:
        """Run tests until one fails.

        Args:
            arguments: tests and files, and options of pytest.
            limit: a name of ``_LIMITS``.

        Returns:
            pytest's exit code, None where a limit or a signal ended it; what it printed.
        """
        cpu, wall = _LIMITS[limit]
        quiet = ["-x", "-q", "--no-header", "--color=no", "--tb=line", "-p", "no:cacheprovider", "--timeout=300"]
        command = [sys.executable, "-m", "pytest", *quiet, "-m", "slow or not slow"]
        limited = f'ulimit -t {cpu} && ulimit -v {_MEMORY} && exec "$@"'
        environment = {
            **os.environ,
            "PYTHONPATH": str(self.code),
            "PYTHONDONTWRITEBYTECODE": "" if self._first else "1",
            "XDG_CACHE_HOME": str(self.cache),
            "TMPDIR": str(self.folder / "tmp"),
        }
        with (self.folder / "output").open("w+", encoding="utf-8", errors="replace") as output:
            process = subprocess.Popen(
                ["sh", "-c", limited, "sh", *command, *arguments],
                cwd=self.code,
                env=environment,
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=subprocess.STDOUT,
                start_new_session=True,
            )
            try:
                code: int | None = process.wait(timeout=wall)
            except subprocess.TimeoutExpired:
                code = None
            finally:
                with contextlib.suppress(ProcessLookupError):
                    os.killpg(process.pid, signal.SIGKILL)
                process.wait()
            output.seek(0)
            return (code if code is not None and 0 <= code <= 5 else None), output.read()


def _link(source: str, target: str) -> None:
    """A second name for a file, or a copy where that cannot be."""
    try:
        os.link(source, target)
    except OSError:
        shutil.copy2(source, target)


@contextlib.contextmanager
def copied(original: Copy | None = None) -> Iterator[Copy]:
    """A copy that is removed in the end: of another copy with its compiled forms, else of the checkout with the user's.

    What is changed in the checkout while mutants are tried does not matter.
    """
    cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    with tempfile.TemporaryDirectory(prefix="mutant-") as name:
        yield Copy(Path(name), cache) if original is None else Copy(Path(name), original.cache, original.code)
