"""Result folders: written completely or not at all, by one run at a time.

Everything is written into a hidden folder inside the result folder and moved into place at the end,
summary.json last: a folder has a result if and only if it has summary.json.  A run that is killed
leaves its hidden folder behind, which the next run removes.  Only those files are replaced or
removed that the manifest of the folder lists.
"""

from __future__ import annotations

import contextlib
import errno
import fcntl
import os
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Self

from mpi4py import MPI

from signorini_fx.errors import OutputError, SignoriniError, cannot_be_written
from signorini_fx.machine import manifest, parallel, signals
from signorini_fx.machine.result_files import folder_path

if TYPE_CHECKING:
    from types import TracebackType

SUMMARY = "summary.json"
# The complete load steps of a run that has not ended.
CHECKPOINT = "checkpoint"


class ResultFolder:
    """The claim of one run on a result folder.  Every method is collective.

    The claim is a lock on the folder itself, which the system releases when the process ends in any
    way.  Used as a context manager, it removes at its end what was written after the last
    ``commit`` or ``add``, and releases the folder.

    ``names``: the files and folders that the run may write.  ``part``: where to write what
    ``commit`` or ``add`` will move into place.  ``committed``: whether there is a result of this
    run.

    Raises:
        OutputError: the folder cannot be written, another run is writing it, or there are files at
            these names that no earlier run has written; later also by ``commit`` and ``add``.
    """

    def __init__(self, comm: MPI.Comm, path: str | Path, names: Iterable[str]) -> None:
        if not str(path):
            raise OutputError("a result folder has a name: '.' is the current folder")
        self._comm = comm
        self._names = (SUMMARY, *names)
        self._made = self.committed = False
        self.path = folder_path(path)
        self.part = self.path / manifest.PART
        self._lock: int | None = None
        parallel.on_root(comm, self._claim)
        self._claimed = True

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        claimed = self._claimed
        self._claimed = False
        if claimed and (
            error is None or isinstance(error, SignoriniError)
        ):  # these are raised on all ranks
            parallel.on_root(self._comm, self._remove)
        elif claimed:  # the other ranks may never get here: this rank removes what it can
            self._remove()

    def commit(self) -> None:
        """Replace the results of earlier runs with what was written, the summary last."""

        def replace(new: list[str]) -> None:
            # Listed before they are moved: if this is interrupted, the next run can remove them.
            manifest.add(self.path, new)
            (self.path / SUMMARY).unlink(missing_ok=True)
            manifest.remove(self.path)
            manifest.add(self.path, new, alone=True)

        with signals.deferred():  # the older result goes and the new one comes as a whole
            parallel.on_root(self._comm, lambda: self._move(replace))
            self.committed = True

    def add(self) -> None:
        """Add what was written since ``commit`` to the results, the summary last."""
        with signals.deferred():
            parallel.on_root(
                self._comm, lambda: self._move(lambda new: manifest.add(self.path, new))
            )

    def _move(self, begin: Callable[[list[str]], None]) -> None:
        try:
            new = manifest.files(self.part)
            refuse_foreign(self.path, new)
            begin(new)
            for name in sorted(new, key=lambda name: name == SUMMARY):
                (self.path / name).parent.mkdir(parents=True, exist_ok=True)
                (self.part / name).replace(self.path / name)
        except OSError as error:
            raise cannot_be_written(self.path, error) from None
        finally:
            self.clear()

    def clear(self) -> None:
        """Remove what is written and not yet in place; on one rank."""
        with contextlib.suppress(OSError):
            manifest.begin_part(self.path)

    def _remove(self) -> None:
        """Remove what is not in place and release the folder; older results stay."""
        manifest.remove_part(self.path)
        if self._made:
            with contextlib.suppress(OSError):
                self.path.rmdir()  # fails if there is something else in it
        self._release()

    def _claim(self) -> None:
        try:
            self._made = not self.path.exists()
            self.path.mkdir(parents=True, exist_ok=True)
            self._lock = os.open(self.path, os.O_RDONLY | os.O_DIRECTORY)
            _lock(self._lock)
            refuse_foreign(self.path, self._names)
            manifest.begin_part(self.path)
        except (OutputError, OSError, ValueError) as error:  # ValueError: a null byte in the path
            self._release()
            if isinstance(error, OutputError):
                raise
            if isinstance(error, BlockingIOError):
                message = "another run is writing it: wait for it, or choose another folder"
                raise OutputError(f"{self.path}: {message}") from None
            raise cannot_be_written(self.path, error) from None

    def _release(self) -> None:
        if self._lock is not None:
            os.close(self._lock)
            self._lock = None


def refuse_foreign(folder: Path, names: Iterable[str]) -> None:
    """Raise ``OutputError`` if a folder has files at these names that no run has written; on one
    rank.
    """
    if foreign := manifest.foreign(folder, names):
        listed = ", ".join(foreign[:5]) + (
            f" and {len(foreign) - 5} more" if len(foreign) > 5 else ""
        )
        reason = (
            "no earlier run lists this as its own, so it stays: move it, or choose another folder"
        )
        raise OutputError(f"{folder}: {listed}: {reason}")


def _lock(descriptor: int) -> None:
    """Lock the folder, or go on without a lock if the file system has none."""
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        if error.errno not in (
            errno.EBADF,
            errno.EINVAL,
            errno.ENOLCK,
            errno.ENOTSUP,
            errno.ENOSYS,
        ):
            raise
