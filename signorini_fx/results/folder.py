"""Result folders: written completely or not at all, by one run at a time.

Everything is written into a hidden folder inside the result folder and moved into place at the end, summary.json last:
a folder has a complete result if and only if it has summary.json.  A run that is killed leaves its hidden folder
behind, which the next run removes.
"""

from __future__ import annotations

import contextlib
import errno
import fcntl
import os
import shutil
from collections.abc import Iterable
from pathlib import Path
from typing import Self

from mpi4py import MPI

from signorini_fx import parallel
from signorini_fx.errors import OutputError, SignoriniError, cannot_be_written

SUMMARY = "summary.json"
# The complete load steps of a run that has not ended.
CHECKPOINT = "checkpoint"
_PART = ".part"


class ResultFolder:
    """The claim of one run on a folder, from its first moment to its last; every method is collective.

    The claim is a lock on the folder itself, which the system releases when the process ends in any way.  Used as a
    context, it removes what was written if ``commit`` was not called.

    Args:
        comm: the ranks of the run.
        path: made if it does not exist.

    Attributes:
        part: where to write what ``commit`` will move into place.

    Raises:
        OutputError: the folder cannot be written, or another run is writing it.
    """

    def __init__(self, comm: MPI.Comm, path: str | Path) -> None:
        self._comm = comm
        self.path = Path(path)
        self.part = self.path / _PART
        self._lock: int | None = None
        parallel.on_root(comm, self._claim)
        self._claimed = True

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: object) -> None:
        if not self._claimed:
            return
        if error is None or isinstance(error, SignoriniError):  # these are raised on all ranks
            self.discard()
        else:  # the other ranks may never get here: this rank removes what it can
            self._remove()

    def reserve(self, size: float) -> None:
        """Check that this many bytes can be written here, see the function ``reserve``.

        Raises:
            OutputError: they cannot be written.
        """
        reserve(self._comm, self.part, size)

    def commit(self, ours: Iterable[str]) -> None:
        """Move what was written into place, the summary last, and release the folder.

        Args:
            ours: names of all files that a run may write: those of an earlier run are removed.
        """

        def move() -> None:
            try:
                (self.path / SUMMARY).unlink(missing_ok=True)
                for name in ours:
                    old = self.path / name
                    if old.is_dir() and not old.is_symlink():
                        shutil.rmtree(old)
                    else:
                        old.unlink(missing_ok=True)
                for source in sorted(self.part.iterdir(), key=lambda path: path.name == SUMMARY):
                    source.replace(self.path / source.name)
                self.part.rmdir()
            except OSError as error:
                shutil.rmtree(self.part, ignore_errors=True)
                raise cannot_be_written(self.path, error) from None
            finally:
                self._release()

        self._claimed = False
        parallel.on_root(self._comm, move)

    def discard(self) -> None:
        """Remove what was written; older results stay."""
        self._claimed = False
        parallel.on_root(self._comm, lambda: self._remove() if self._lock is not None else None)

    def _remove(self) -> None:
        shutil.rmtree(self.part, ignore_errors=True)
        with contextlib.suppress(OSError):
            self.path.rmdir()  # fails if there is something else in it
        self._release()

    def _claim(self) -> None:
        try:
            self.path.mkdir(parents=True, exist_ok=True)
            self._lock = os.open(self.path, os.O_RDONLY | os.O_DIRECTORY)
            _lock(self._lock)
            shutil.rmtree(self.part, ignore_errors=True)
            self.part.mkdir()
        except BlockingIOError:
            self._release()
            message = "another run is writing it: wait for it, or choose another folder"
            raise OutputError(f"{self.path}: {message}") from None
        except (OSError, ValueError) as error:  # ValueError: a null byte in the path
            self._release()
            raise cannot_be_written(self.path, error) from None

    def _release(self) -> None:
        if self._lock is not None:
            os.close(self._lock)
            self._lock = None


def reserve(comm: MPI.Comm, part: Path, size: float) -> None:
    """Check that this many bytes can be written: libraries that write fields do not survive a full disk; collective.

    Args:
        comm: the ranks.
        part: a folder inside the one that an error names.
        size: bytes.

    Raises:
        OutputError: they cannot be written.
    """

    def allocate() -> None:
        trial = part / "reserved"
        try:
            with trial.open("wb") as file:
                os.posix_fallocate(file.fileno(), 0, max(int(size), 1))
            trial.unlink()
        except OSError as error:
            if error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG):
                raise cannot_be_written(part.parent, error) from None
            trial.unlink(missing_ok=True)  # the file system cannot tell

    parallel.on_root(comm, allocate)


def _lock(descriptor: int) -> None:
    """Lock the folder, or go on without a lock if the file system has none.

    Raises:
        BlockingIOError: another process holds the lock.
    """
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        if error.errno not in (errno.EBADF, errno.EINVAL, errno.ENOLCK, errno.ENOTSUP, errno.ENOSYS):
            raise
