"""The lines of an Abaqus input file with those of the files that it includes, which must be in its folder or below."""

from __future__ import annotations

import codecs
import os
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from signorini_fx.errors import MeshError
from signorini_fx.mechanics.mesh.files.abaqus_blocks import DeckBlock, blocks, heading, joined_lines
from signorini_fx.mechanics.mesh.files.abaqus_tables import NumberTable

# A file may include another one several times, but the whole may not grow without bounds.
_MOST_FILES = 1000
_DEEPEST = 20
_LARGEST = 1 << 30  # bytes


@dataclass
class Source:
    """An input file and what it includes.

    Attributes:
        file: the input file.
        files: the file and all that it includes, as they are found.
        size: characters that have been read so far.
    """

    file: Path
    files: list[Path] = field(default_factory=list)
    size: int = 0

    def blocks(self) -> list[DeckBlock]:
        """All keywords.

        Raises:
            MeshError: a file cannot be read, or is outside of the folder; there are too many.
        """
        return list(blocks(self._lines(self.file, "", 0)))

    def _lines(self, file: Path, label: str, depth: int) -> Iterator[tuple[int, str, str | NumberTable]]:
        """Number, name of the file as it is included, and text of each line, or of many that are numbers."""
        try:
            text = self._text(file)
        except OSError as error:
            raise MeshError(f"{file}: cannot be read: {error.strerror or error}") from None
        except ValueError as error:
            raise MeshError(f"{file}: {error}") from None
        self.files.append(file)
        self.size += len(text)
        for number, line in joined_lines(text):
            if isinstance(line, NumberTable):
                yield number, label, line
                continue
            keyword, parameters = heading(line) if line.startswith("*") else ("", {})
            if keyword != "INCLUDE":
                yield number, label, line
            if keyword == "INCLUDE" or (keyword and "INPUT" in parameters):
                try:
                    included = self._beside(parameters["INPUT"], depth)
                except KeyError:
                    raise self._error(number, label, keyword, "INPUT is missing") from None
                except (OSError, ValueError) as error:
                    raise self._error(number, label, keyword, str(error)) from None
                yield from self._lines(included, parameters["INPUT"], depth + 1)

    def _text(self, file: Path) -> str:
        """The text of a file, whose size is looked at before it is read.

        Raises:
            ValueError: it is too large.
        """
        with file.open("rb") as stream:
            self._check_size(os.fstat(stream.fileno()).st_size)
            content = stream.read()
        wide = content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
        text = content.decode("utf-16" if wide else "utf-8-sig", errors="replace")
        return text.replace("\r\n", "\n").replace("\r", "\n") if "\r" in text else text

    def _check_size(self, size: int) -> None:
        """Refuse a file that makes the whole too large.

        Raises:
            ValueError: it does.
        """
        if self.size + size > _LARGEST:
            limit = f"an input file and those that it includes may have {_LARGEST:.1e} together"
            raise ValueError(f"the file has {size:.1e} bytes; {limit}")

    def _error(self, number: int, label: str, keyword: str, why: str) -> MeshError:
        return MeshError(f"{self.file}: line {number}{f' of {label}' if label else ''}, *{keyword}: {why}")

    def _beside(self, name: str, depth: int) -> Path:
        """The file that is included by a name.

        Raises:
            ValueError: it is not in the folder of the input file, or there are too many.
        """
        if depth >= _DEEPEST:
            raise ValueError(f"files include each other more than {_DEEPEST} times deep")
        if len(self.files) >= _MOST_FILES:
            raise ValueError(f"there are more than {_MOST_FILES} included files")
        folder = self.file.parent.resolve()
        path = (folder / name.replace("\\", "/")).resolve()
        if not path.is_relative_to(folder):
            raise ValueError(f"{name!r} is outside of the folder of the input file: put it there")
        if not os.path.isfile(path):
            raise ValueError(f"there is no file {name!r} in the folder of the input file")
        self._check_size(path.stat().st_size)
        return path


def files_of(file: Path) -> list[Path]:
    """An input file and all files that it includes.

    Raises:
        MeshError: one of them cannot be read.
    """
    source = Source(file)
    source.blocks()
    return source.files
