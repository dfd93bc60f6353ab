"""Which files in a folder are results: those that the folder's manifest lists; nothing else is replaced or removed.

The manifest is a text file in the folder, one path a line.  A folder within it may have a manifest of its own.  What is
not complete yet stands in a hidden folder with a name that nobody else uses.
"""

from __future__ import annotations

import contextlib
import os
import shutil
from collections.abc import Iterable, Iterator
from pathlib import Path

MANIFEST, PART = ".signorini_fx", ".signorini_fx.part"
_NEW = f"{MANIFEST}.new"


def add(folder: Path, names: Iterable[str], *, alone: bool = False) -> None:
    """List files.

    Args:
        folder: an existing folder.
        names: paths in it.
        alone: whether nothing else is listed any more.

    Raises:
        OSError: the manifest cannot be written.
    """
    every = sorted({*names} if alone else {*names, *_lines(folder)})
    new = folder / _NEW
    new.write_text("".join(f"{name}\n" for name in every), encoding="utf-8")
    new.replace(folder / MANIFEST)


def ours(folder: Path) -> set[str]:
    """The files in a folder that manifests list, and these manifests, as paths in it."""
    if not folder.is_dir():
        return set()
    # What a manifest says of places outside, also by way of links, does not count.
    found = {name for name in _lines(folder) if _within(folder, name)}
    found |= {name for name in (MANIFEST, _NEW) if (folder / name).is_file()}
    return found | {f"{inner.name}/{name}" for inner in _folders(folder) for name in ours(inner)}


def foreign(folder: Path, names: Iterable[str]) -> list[str]:
    """What is at the place of these files and folders, or in these folders, and is not listed."""
    listed = ours(folder)
    found = []
    for name in names:
        path = folder / name
        if path.is_dir() and not path.is_symlink():
            inside = (f"{name}/{file}" for file in files(path))
            found += [file for file in inside if file not in listed]
        elif os.path.lexists(path) and name not in listed:
            found.append(name)
    return found


def remove(folder: Path) -> None:
    """Remove everything that is listed, and the folders in it that are empty then; the manifest stays.

    Raises:
        OSError: something cannot be removed.
    """
    # Manifests go last, so that the next run can go on if this one is interrupted.
    for name in sorted(ours(folder) - {MANIFEST}, key=lambda name: name.endswith(MANIFEST)):
        inner = (folder / name).parent
        (folder / name).unlink(missing_ok=True)
        if inner != folder:
            shutil.rmtree(inner / PART, ignore_errors=True)
        _remove_empty(inner, folder)


def files(folder: Path) -> list[str]:
    """All files in a folder, as paths in it."""
    return sorted(str(path.relative_to(folder)) for path in _files(folder))


def _lines(folder: Path) -> list[str]:
    try:
        return (folder / MANIFEST).read_text(encoding="utf-8").splitlines()
    except (OSError, ValueError):
        return []


def _within(folder: Path, name: str) -> bool:
    parts = Path(name).parts
    inner = [folder.joinpath(*parts[: k + 1]) for k in range(len(parts) - 1)]
    return bool(parts) and ".." not in parts and not os.path.isabs(name) and not any(map(Path.is_symlink, inner))


def _folders(folder: Path) -> list[Path]:
    return [path for path in folder.iterdir() if path.is_dir() and not path.is_symlink() and path.name != PART]


def _files(folder: Path) -> Iterator[Path]:
    """All files below a folder but those that are not complete; a link is a file."""
    for root, folders, names in os.walk(folder):
        folders[:] = [name for name in folders if name != PART]
        yield from (Path(root, name) for name in names)
        yield from (Path(root, name) for name in folders if Path(root, name).is_symlink())


def _remove_empty(inner: Path, folder: Path) -> None:
    with contextlib.suppress(OSError):  # there is something in it
        while inner != folder:
            inner.rmdir()
            inner = inner.parent
