"""JSON whose objects know the line that they begin on, for messages.  No dolfinx here."""

from __future__ import annotations

import json
import re
from bisect import bisect_right
from pathlib import Path
from typing import Any

from signorini_fx.errors import MeshError

# Blanks, and comments of both kinds, which Kratos allows.
_BLANKS = re.compile(r"(?:\s|//[^\n]*|/\*.*?\*/)*", re.DOTALL)
_DEEPEST = 100


class JsonError(ValueError):
    """What is wrong with an object or a value, and where.

    Attributes:
        text: with the line.
    """

    def __init__(self, line: int, why: str) -> None:
        self.text = f"line {line}: {why}"
        super().__init__(self.text)


class JsonObject(dict[str, Any]):
    """An object of a file.

    Attributes:
        line: that it begins on, from 1.
    """

    line: int = 0

    def error(self, why: str) -> JsonError:
        """An error in this object."""
        return JsonError(self.line, why)

    def text(self, key: str, otherwise: str | None = None) -> str:
        """A string.

        Raises:
            JsonError: there is none.
        """
        value = self.get(key, otherwise)
        if not isinstance(value, str):
            raise self.error(f"{key}: a string is expected, not {_shown(value)}")
        return value

    def number(self, key: str, otherwise: float | None = None) -> float:
        """A number.

        Raises:
            JsonError: there is none, or it is not finite.
        """
        value = self.get(key, otherwise)
        if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) < float("inf"):
            raise self.error(f"{key}: a number is expected, not {_shown(value)}")
        return float(value)

    def part(self, key: str) -> JsonObject:
        """An object; empty: there is none.

        Raises:
            JsonError: it is something else.
        """
        value = self.get(key)
        if value is None:
            value = JsonObject()
            value.line = self.line
        if not isinstance(value, JsonObject):
            raise self.error(f"{key}: an object is expected, not {_shown(value)}")
        return value

    def parts(self, key: str) -> list[JsonObject]:
        """The objects of a list; empty: there is none.

        Raises:
            JsonError: it is something else.
        """
        value = self.get(key, [])
        if not isinstance(value, list) or not all(isinstance(entry, JsonObject) for entry in value):
            raise self.error(f"{key}: a list of objects is expected, not {_shown(value)}")
        return value

    def words(self, key: str) -> list[str]:
        """The strings of a list, or one alone; empty: there is none.

        Raises:
            JsonError: it is something else.
        """
        value = self.get(key, [])
        value = [value] if isinstance(value, str) else value
        if not isinstance(value, list) or not all(isinstance(entry, str) for entry in value):
            raise self.error(f"{key}: a list of strings is expected, not {_shown(value)}")
        return value


def read_object(file: Path) -> JsonObject:
    """The object that a file holds.

    Raises:
        MeshError: it cannot be read, or is no JSON; the message says on which line.
    """
    try:
        text = file.read_text(encoding="utf-8")
    except OSError as error:
        raise MeshError(f"{file}: cannot be read: {error.strerror}") from None
    except UnicodeDecodeError:
        raise MeshError(f"{file}: is no text in UTF-8") from None
    reader = _JsonText(text)
    try:
        value, end = reader.value(reader.after_blanks(0), 0)
        if (end := reader.after_blanks(end)) < len(text):
            raise reader.error(end, "there is more after its end")
        if not isinstance(value, JsonObject):
            raise reader.error(0, "an object in braces is expected")
    except JsonError as error:
        raise MeshError(f"{file}: {error.text}") from None
    return value


class _JsonText:
    """A text that is read; strings and numbers by the decoder of Python."""

    def __init__(self, text: str) -> None:
        self._text = text
        self._decoder = json.JSONDecoder(parse_constant=self._no_number)
        self._ends = [match.start() for match in re.finditer("\n", text)]

    def line(self, position: int) -> int:
        """Of a position, from 1."""
        return bisect_right(self._ends, position - 1) + 1

    def error(self, position: int, why: str) -> JsonError:
        """An error at a position."""
        return JsonError(self.line(position), why)

    @staticmethod
    def _no_number(word: str) -> float:
        raise ValueError(f"{word} is no number")

    def after_blanks(self, position: int) -> int:
        """The next place that is neither blank nor comment."""
        match = _BLANKS.match(self._text, position)
        return position if match is None else match.end()

    def _expect(self, position: int, characters: str, entry: str) -> str:
        if position >= len(self._text):
            raise self.error(position, f"the file ends where {entry} is expected")
        if self._text[position] not in characters:
            raise self.error(position, f"{entry} is expected, not {self._text[position : position + 20]!r}")
        return self._text[position]

    def value(self, position: int, depth: int) -> tuple[Any, int]:
        """The value at a position, and the place after it."""
        if depth > _DEEPEST:
            raise self.error(position, "nested too deeply")
        if position >= len(self._text):
            raise self.error(position, "the file ends where a value is expected")
        if self._text[position] == "{":
            return self._object(position, depth)
        if self._text[position] == "[":
            return self._list(position, depth)
        try:
            return self._decoder.raw_decode(self._text, position)
        except json.JSONDecodeError as error:
            raise self.error(error.pos, f"{error.msg[0].lower()}{error.msg[1:]}") from None
        except ValueError as error:
            raise self.error(position, str(error)) from None

    def _object(self, position: int, depth: int) -> tuple[JsonObject, int]:
        collected = JsonObject()
        collected.line = self.line(position)
        position = self.after_blanks(position + 1)
        if self._text[position : position + 1] == "}":
            return collected, position + 1
        while True:
            self._expect(position, '"', "a name in quotation marks")
            name, end = self.value(position, depth)
            if name in collected:
                raise self.error(position, f"{name} is there twice")
            position = self.after_blanks(end)
            self._expect(position, ":", "a colon")
            collected[name], position = self.value(self.after_blanks(position + 1), depth + 1)
            position = self.after_blanks(position)
            if self._expect(position, ",}", "a comma or the end of an object") == "}":
                return collected, position + 1
            position = self.after_blanks(position + 1)

    def _list(self, position: int, depth: int) -> tuple[list[Any], int]:
        collected: list[Any] = []
        position = self.after_blanks(position + 1)
        if self._text[position : position + 1] == "]":
            return collected, position + 1
        while True:
            entry, position = self.value(position, depth + 1)
            collected.append(entry)
            position = self.after_blanks(position)
            if self._expect(position, ",]", "a comma or the end of a list") == "]":
                return collected, position + 1
            position = self.after_blanks(position + 1)


def _shown(value: Any) -> str:
    """A value in a message."""
    return "nothing" if value is None else repr(value)[:60]
