"""The manifest of a folder, which lists the files that are results; no other files are replaced or
removed.

The manifest is a text file in the folder, one path a line.  Runs write no symbolic links, so a link
is never a result.  Incomplete files are in a hidden folder; that of an inner folder is listed.
"""

from __future__ import annotations

import contextlib
import os
import shutil
from collections.abc import Iterable
from pathlib import Path

MANIFEST, PART = ".signorini_fx", ".signorini_fx.part"
_NEW = f"{MANIFEST}.new"


def add(folder: Path, names: Iterable[str], *, alone: bool = False) -> None:
    """Add files to the manifest.

    Args:
        folder: the folder.
        names: paths of the files in the folder.
        alone: whether earlier entries are dropped.
    """
    listed = {*names, *(() if alone else _lines(folder))}
    new = folder / _NEW
    new.unlink(missing_ok=True)
    new.write_text("".join(f"{name}\n" for name in sorted(listed)), encoding="utf-8")
    new.replace(folder / MANIFEST)


def begin_part(folder: Path) -> None:
    """Make a new, empty hidden folder for incomplete files."""
    remove_part(folder)
    (folder / PART).mkdir()


def remove_part(folder: Path) -> None:
    """Remove the hidden folder of incomplete files."""
    shutil.rmtree(folder / PART, ignore_errors=True)


def ours(folder: Path) -> set[str]:
    """Return the paths, relative to the folder, of the files that its manifest lists, and of the
    manifest.
    """
    # Entries that lead outside the folder, also through links, are ignored.
    listed = {name for name in _lines(folder) if _within(folder, name)}
    return listed.union(name for name in (MANIFEST, _NEW) if (folder / name).is_file())


def foreign(folder: Path, names: Iterable[str]) -> list[str]:
    """Return the files and folders with these names, or inside folders with these names, that are
    not listed.
    """
    listed = ours(folder)
    unlisted = list[str]()
    for name in names:
        path = folder / name
        if path.is_dir() and not path.is_symlink():
            inside = (f"{name}/{file}" for file in files(path))
            unlisted += [
                file for file in inside if file not in listed or (folder / file).is_symlink()
            ]
        elif os.path.lexists(path) and (name not in listed or path.is_symlink()):
            unlisted.append(name)
    return unlisted


def remove(folder: Path, inner: str = "") -> None:
    """Remove all listed files, and folders that become empty; the manifest stays.

    Args:
        folder: the folder.
        inner: only files whose path starts with this are removed.
    """
    for name in ours(folder) - {MANIFEST}:
        file = folder / name
        if not name.startswith(inner):
            continue
        if file.name == PART:
            remove_part(file.parent)
        elif not file.is_symlink() and not file.is_dir():
            file.unlink(missing_ok=True)
        _remove_empty(file.parent, folder)


def files(folder: Path) -> list[str]:
    """Return the paths of all files in a folder, relative to it, except incomplete ones; a link
    counts as a file.
    """
    found = []
    for root, folders, names in os.walk(folder):
        folders[:] = [name for name in folders if name != PART]
        links = [name for name in folders if Path(root, name).is_symlink()]
        found += [str(Path(root, name).relative_to(folder)) for name in (*names, *links)]
    return sorted(found)


def _lines(folder: Path) -> list[str]:
    """Return the entries of the manifest; a link is not accepted as a manifest."""
    manifest = folder / MANIFEST
    try:
        return [] if manifest.is_symlink() else manifest.read_text(encoding="utf-8").splitlines()
    except (OSError, ValueError):
        return []


def _within(folder: Path, name: str) -> bool:
    """Return whether a path stays within the folder, without passing a link or another result
    folder.
    """
    parts = Path(name).parts
    if not parts or ".." in parts or os.path.isabs(name):
        return False
    way = [folder.joinpath(*parts[: k + 1]) for k in range(len(parts) - 1)]
    return not any(path.is_symlink() or os.path.lexists(path / MANIFEST) for path in way)


def _remove_empty(inner: Path, folder: Path) -> None:
    with contextlib.suppress(OSError):  # the folder is not empty
        while inner != folder:
            inner.rmdir()
            inner = inner.parent
