"""Which files in a folder are results: those that the folder's manifest lists; nothing else is replaced or removed.

The manifest is a text file in the folder, one path a line.  A path that ends with a slash is a folder that the same run
has made, with a manifest of its own whose line ``../`` says so.  Both must say it: a folder that another run has filled
is a result of its own, wherever it is.  Runs write no symbolic links, so that no link is a result.  What is not
complete yet stands in a hidden folder, and a new manifest in a hidden file, which begin with a mark: without it they
are somebody else's, whatever they are called.
"""

from __future__ import annotations

import contextlib
import os
import shutil
from collections.abc import Iterable, Iterator
from pathlib import Path

MANIFEST, PART = ".signorini_fx", ".signorini_fx.part"
_NEW = f"{MANIFEST}.new"
_OF_THE_FOLDER_ABOVE = "../"
# The first line of a manifest, and what the file of the same name in a folder of what is not complete holds.
_MARK = "./"


def add(folder: Path, names: Iterable[str], *, alone: bool = False, inner: bool = False) -> None:
    """List files.

    Args:
        folder: an existing folder.
        names: paths in it.
        alone: whether nothing else is listed any more.
        inner: whether the folder belongs to the run of the folder above it, see ``begin_inner``.

    Raises:
        OSError: the manifest cannot be written, or a file that is none is in the way.
    """
    listed = {*names, *(() if alone else _lines(folder)), *([_OF_THE_FOLDER_ABOVE] if inner else [])} - {_MARK}
    new = folder / _NEW
    if _marked(new):
        new.unlink()
    with new.open("x", encoding="utf-8") as file:
        file.write("".join(f"{name}\n" for name in [_MARK, *sorted(listed)]))
    new.replace(folder / MANIFEST)


def begin_part(folder: Path) -> None:
    """Make the hidden folder of what is not complete anew.

    Raises:
        OSError: it cannot be made, or a folder that no run has made is in its place.
    """
    remove_part(folder)
    part = folder / PART
    part.mkdir()
    (part / MANIFEST).write_text(f"{_MARK}\n", encoding="utf-8")


def remove_part(folder: Path) -> None:
    """Remove the hidden folder of what is not complete, if a run has made it."""
    if _is_part(folder / PART):
        shutil.rmtree(folder / PART, ignore_errors=True)


def complete_part(folder: Path, target: Path) -> None:
    """Give the hidden folder of what was not complete another name, without its mark.

    Raises:
        OSError: it cannot be done.
    """
    (folder / PART / MANIFEST).unlink()
    (folder / PART).rename(target)


def files_of_part(folder: Path) -> list[str]:
    """All files in the hidden folder but its mark, as paths in it."""
    return [name for name in files(folder / PART) if name != MANIFEST]


def _marked(file: Path) -> bool:
    """Whether a file begins with the mark of runs; a link does not, and one that was not even begun is empty."""
    try:
        with file.open("rb") as stream:
            return not file.is_symlink() and stream.read(len(_MARK) + 1) in (b"", f"{_MARK}\n".encode())
    except OSError:
        return False


def _is_part(part: Path) -> bool:
    """Whether a run has made a hidden folder; one that is empty was not even begun."""
    if part.is_symlink() or not part.is_dir():
        return False
    try:
        return _marked(part / MANIFEST) or not any(part.iterdir())
    except OSError:  # another rank may remove it meanwhile
        return False


def begin_inner(folder: Path, name: str) -> None:
    """Make a folder that belongs to the run that fills the folder above it, and list it there.

    Args:
        folder: an existing folder.
        name: of the folder in it; what is there already is not ``foreign``.

    Raises:
        OSError: a manifest cannot be written.
    """
    add(folder, [f"{name}/"])
    (folder / name).mkdir(exist_ok=True)
    add(folder / name, [], inner=True)


def is_inner(folder: Path) -> bool:
    """Whether a folder says that it belongs to the run that fills the folder above it."""
    return _OF_THE_FOLDER_ABOVE in _lines(folder)


def ours(folder: Path) -> set[str]:
    """The files in a folder that its manifest lists, with those of inner folders of the same run, as paths in it."""
    if not folder.is_dir():
        return set()
    # What a manifest says of places outside, also by way of links, does not count.
    listed = {name for name in _lines(folder) if _within(folder, name)}
    folders = {name.rstrip("/") for name in listed if name.endswith("/")}
    inner = {name for name in folders if not (folder / name).is_symlink() and is_inner(folder / name)}
    of_the_manifest = {MANIFEST} if (folder / MANIFEST).is_file() else set()
    of_the_manifest |= {_NEW} if _marked(folder / _NEW) else set()
    return {name for name in listed if not name.endswith("/")}.union(
        of_the_manifest, *({f"{name}/{file}" for file in ours(folder / name)} for name in inner)
    )


def foreign(folder: Path, names: Iterable[str]) -> list[str]:
    """What is at the place of these files and folders, or in these folders, and is not listed."""
    listed = ours(folder)
    unlisted = [MANIFEST] if (folder / MANIFEST).is_symlink() else []
    unlisted += [_NEW] if os.path.lexists(folder / _NEW) and not _marked(folder / _NEW) else []
    unlisted += [PART] if os.path.lexists(folder / PART) and not _is_part(folder / PART) else []
    for name in names:
        path = folder / name
        if path.is_dir() and not path.is_symlink():
            inside = (f"{name}/{file}" for file in files(path))
            unlisted += [file for file in inside if file not in listed or (folder / file).is_symlink()]
        elif os.path.lexists(path) and (name not in listed or path.is_symlink()):
            unlisted.append(name)
    return unlisted


def remove(folder: Path) -> None:
    """Remove everything that is listed, and the folders in it that are empty then; the manifest stays.

    Raises:
        OSError: something cannot be removed.
    """
    names = ours(folder) - {MANIFEST}
    # Manifests go last, so that the next run can go on if this one is interrupted.
    for name in sorted(names, key=lambda name: name.endswith(MANIFEST)):
        file = folder / name
        if not file.is_symlink() and not file.is_dir():
            file.unlink(missing_ok=True)
        if file.name == MANIFEST:  # of an inner folder
            remove_part(file.parent)
        _remove_empty(file.parent, folder)


def files(folder: Path) -> list[str]:
    """All files in a folder, as paths in it."""
    return sorted(str(path.relative_to(folder)) for path in _files(folder))


def _lines(folder: Path) -> list[str]:
    """What the manifest lists; a link is no manifest."""
    manifest = folder / MANIFEST
    try:
        return [] if manifest.is_symlink() else manifest.read_text(encoding="utf-8").splitlines()
    except (OSError, ValueError):
        return []


def _within(folder: Path, name: str) -> bool:
    """Whether a path leads to a place in the folder, with no link and no other result folder on the way."""
    parts = Path(name).parts
    if not parts or ".." in parts or os.path.isabs(name):
        return False
    way = [folder.joinpath(*parts[: k + 1]) for k in range(len(parts) - 1)]
    return not any(path.is_symlink() or os.path.lexists(path / MANIFEST) for path in way)


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
