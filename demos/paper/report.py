"""How results are shown: tables as text, CSV and HTML with the printed numbers beside them, and the page with all."""

from __future__ import annotations

import base64
import csv
import html
import math
import sys
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

_WIDTH = 110


def progress(text: str) -> None:
    """What is being computed, on one line of a terminal; silent elsewhere."""
    if sys.stderr.isatty():
        print(f"\r\x1b[K{text}", end="", file=sys.stderr, flush=True)


def power(value: float) -> str:
    """1e4 for 10000.0."""
    return f"1e{round(math.log10(value))}"


@dataclass(frozen=True)
class Entry:
    """A number that we computed, and the one that the paper prints, None where it prints none.

    Attributes:
        computed: a number, or text.
        printed: the like.
        form: format specification for both; they are equal if they look equal in it.
    """

    computed: Any
    printed: Any = None
    form: str = ""

    @property
    def differs(self) -> bool:
        """Whether the printed number is another one."""
        return self.printed is not None and self.text != self.printed_text

    @property
    def text(self) -> str:
        """The computed number."""
        return shown(self.computed, self.form)

    @property
    def printed_text(self) -> str:
        """The printed number, empty where there is none."""
        return "" if self.printed is None else shown(self.printed, self.form)


def shown(value: Any, form: str) -> str:
    """A value as the tables show it."""
    if value is None:
        return ""
    if isinstance(value, str):
        return value
    text = format(value, form)
    if "e" in form:  # 6.85e-1, as the paper writes it
        digits, power = text.split("e")
        text = f"{digits}e{int(power)}"
    return text


@dataclass(frozen=True)
class Table:
    """A table, its first column the labels of the rows.

    Attributes:
        name: stem of its files.
        title: one line.
        columns: headings, that of the labels first.
        rows: as many items each: label, then ``Entry`` or plain text.
        caption: what it shows.
        notes: where and why it differs from the paper, and what else is to be said.
        numbers: the same in the layout of ``printed.json``, or whatever JSON can hold.
    """

    name: str
    title: str
    columns: Sequence[str]
    rows: Sequence[Sequence[Any]]
    caption: str = ""
    notes: Sequence[str] = ()
    numbers: dict[str, Any] = field(default_factory=dict)

    @property
    def entries(self) -> list[list[Entry]]:
        """The rows without their labels."""
        return [[item if isinstance(item, Entry) else Entry(item) for item in row[1:]] for row in self.rows]

    @property
    def labels(self) -> list[str]:
        """The labels of the rows."""
        return [str(row[0]) for row in self.rows]

    @property
    def comparable(self) -> list[Entry]:
        """The entries that the paper prints."""
        return [entry for row in self.entries for entry in row if entry.printed is not None]

    @property
    def verdict(self) -> str:
        """How many of the printed entries we have, empty where nothing is printed."""
        if not self.comparable:
            return ""
        equal = sum(not entry.differs for entry in self.comparable)
        return f"{equal} of {len(self.comparable)} printed numbers equal"

    def _printed(self) -> tuple[list[str], list[list[str]]]:
        """Headings and entries of the columns in which the paper prints anything."""
        columns = zip(*self.entries, strict=True)
        kept = [k for k, column in enumerate(columns) if any(entry.printed is not None for entry in column)]
        return [self.columns[k + 1] for k in kept], [[row[k].printed_text for k in kept] for row in self.entries]

    def text(self) -> str:
        """The table for a terminal: computed on the left, printed on the right."""
        computed = [[entry.text + "*" * entry.differs for entry in row] for row in self.entries]
        blocks = [_block(self.columns, self.labels, computed, "computed" if self.comparable else "")]
        if self.comparable:
            columns, printed = self._printed()
            blocks.append(_block(["", *columns], ["" for _ in self.rows], printed, "printed"))
        body = ["   |".join(parts).rstrip() for parts in zip(*blocks, strict=True)]
        lines = [self.title, *textwrap.wrap(self.caption, _WIDTH), "", *body]
        if self.comparable:
            differing = "; * differs from the printed number" if any(e.differs for e in self.comparable) else ""
            lines += ["", f"{self.verdict}{differing}"]
        for note in self.notes:
            lines += textwrap.wrap(note, _WIDTH, initial_indent="- ", subsequent_indent="  ")
        return "\n".join(lines) + "\n"

    def write(self, folder: Path) -> None:
        """Text and CSV; columns with printed numbers are followed by these."""
        (folder / f"{self.name}.txt").write_text(self.text(), encoding="utf-8")
        printed = [any(row[k].printed is not None for row in self.entries) for k in range(len(self.columns) - 1)]
        with (folder / f"{self.name}.csv").open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            heading = [self.columns[0]]
            for name, also in zip(self.columns[1:], printed, strict=True):
                heading += [name, f"{name} (printed)"] if also else [name]
            writer.writerow(heading)
            for label, row in zip(self.labels, self.entries, strict=True):
                line = [label]
                for entry, also in zip(row, printed, strict=True):
                    line += [entry.computed, entry.printed] if also else [entry.computed]
                writer.writerow(line)

    def html(self) -> str:
        """The table for the page."""
        found = [[_cell(entry.text, "differs" if entry.differs else "") for entry in row] for row in self.entries]
        tables = _html_table(self.columns, self.labels, found, "computed" if self.comparable else "")
        if self.comparable:
            columns, printed = self._printed()
            theirs = [[_cell(text) for text in row] for row in printed]
            tables += _html_table([self.columns[0], *columns], self.labels, theirs, "printed in the paper")
        verdict = f'<p class="verdict">{self.verdict}</p>' if self.comparable else ""
        notes = "".join(f"<li>{html.escape(note)}</li>" for note in self.notes)
        return (
            f'<section id="{self.name}"><h3>{html.escape(self.title)}</h3><p>{html.escape(self.caption)}</p>'
            f'<div class="pair">{tables}</div>{verdict}{f"<ul>{notes}</ul>" if notes else ""}</section>'
        )


def _block(columns: Sequence[str], labels: list[str], cells: list[list[str]], heading: str) -> list[str]:
    """A heading and right-aligned columns; the labels are left-aligned."""
    rows = [list(columns), *([label, *row] for label, row in zip(labels, cells, strict=True))]
    # A mark does not push the digits out of line.
    rows = [[row[0], *(item if item.endswith("*") else item + " " for item in row[1:])] for row in rows]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = [
        "  ".join([row[0].ljust(widths[0]), *(item.rjust(w) for item, w in zip(row[1:], widths[1:], strict=True))])
        for row in rows
    ]
    width = max(map(len, lines))
    return [*([heading.center(width)] if heading else []), *(line.ljust(width) for line in lines)]


def _cell(text: str, kind: str = "") -> str:
    mark = " &ne;" if kind == "differs" else ""
    return f"<td{f' class={kind}' if kind else ''}>{html.escape(text)}{mark}</td>"


def _html_table(columns: Sequence[str], labels: list[str], cells: list[list[str]], heading: str) -> str:
    head = "".join(f"<th>{html.escape(name)}</th>" for name in columns)
    body = "".join(
        f"<tr><th>{html.escape(label)}</th>{''.join(row)}</tr>" for label, row in zip(labels, cells, strict=True)
    )
    return f"<table><caption>{heading}</caption><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


@dataclass(frozen=True)
class Picture:
    """A figure: its files are name.png and name.pdf.

    Attributes:
        name: stem of its files.
        title: one line.
        caption: what it shows.
        notes: what is to be said of it beside the paper.
        tables: tables that belong to it.
    """

    name: str
    title: str
    caption: str
    notes: Sequence[str] = ()
    tables: Sequence[Table] = ()

    def html(self, folder: Path) -> str:
        """The figure for the page, the picture inside it."""
        data = base64.b64encode((folder / f"{self.name}.png").read_bytes()).decode()
        notes = "".join(f"<li>{html.escape(note)}</li>" for note in self.notes)
        return (
            f'<section id="{self.name}"><h3>{html.escape(self.title)}</h3>'
            f'<figure><img alt="{html.escape(self.title)}" src="data:image/png;base64,{data}">'
            f"<figcaption>{html.escape(self.caption)}</figcaption></figure>"
            f"{f'<ul>{notes}</ul>' if notes else ''}{''.join(table.html() for table in self.tables)}</section>"
        )


_STYLE = """
:root { color-scheme: light; }
body { font: 15px/1.5 system-ui, sans-serif; color: #1a1a1a; max-width: 74rem; margin: 2rem auto; padding: 0 1rem; }
h1 { font-size: 1.5rem; } h2 { margin-top: 3rem; border-bottom: 1px solid #c8c8c8; } h3 { margin-top: 2.2rem; }
nav a { margin-right: .8rem; white-space: nowrap; }
.pair { display: flex; flex-wrap: wrap; gap: 1rem 2.5rem; overflow-x: auto; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; }
caption { text-align: left; color: #6b6b6b; padding-bottom: .2rem; }
th, td { padding: .12rem .55rem; text-align: right; }
thead th { border-bottom: 1px solid #1a1a1a; font-weight: 600; vertical-align: bottom; }
tbody th { font-weight: 400; text-align: left; }
td.differs { background: #fbe3c0; font-weight: 700; }
.verdict { color: #6b6b6b; margin: .4rem 0; }
figure { margin: 0; } img { max-width: 100%; height: auto; } figcaption, section > p { max-width: 54rem; }
li { max-width: 54rem; }
"""

_INTRODUCTION = """
Every number and curve below was computed by <code>./env python3 demos/paper.py</code> (<code>make paper</code>) with
signorini_fx; nothing is copied from the paper but the numbers under &ldquo;printed&rdquo;.  Where the two are not the
same, the computed number is marked, and a note says what the likely reason is.  Unless a caption says otherwise:
uniform mesh of 120 x 40 bilinear quadrilaterals, plane strain, nodal rule on the contact boundary, sigma = 1.
"""


def write_page(
    folder: Path, tables: Sequence[Table], figures: Sequence[Picture], studies: Sequence[Table], seconds: float
) -> None:
    """One page with everything, its pictures inside it."""
    overview = "".join(
        f'<tr><th><a href="#{table.name}">{html.escape(table.title)}</a></th><td>{table.verdict}</td></tr>'
        for table in [*tables, *studies]
        if table.comparable
    )
    links = [
        " ".join(f'<a href="#{item.name}">{html.escape(item.title.partition(":")[0])}</a>' for item in items)
        for items in (tables, figures, studies)
    ]
    page = (
        '<!DOCTYPE html><html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width"><title>Kunisch &amp; Stadler 2005, recomputed</title>'
        f"<style>{_STYLE}</style></head><body>"
        "<h1>K. Kunisch, G. Stadler: Generalized Newton methods for the 2D-Signorini contact problem with friction "
        "in function space (2005), section 7, recomputed</h1>"
        f"<p>{_INTRODUCTION}</p><nav>{''.join(f'<p>{line}</p>' for line in links)}</nav>"
        f"<table><tbody>{overview}</tbody></table>"
        f"<h2>Tables</h2>{''.join(table.html() for table in tables)}"
        f"<h2>Figures</h2>{''.join(figure.html(folder) for figure in figures)}"
        f"<h2>Further studies</h2>{''.join(study.html() for study in studies)}"
        f'<p class="verdict">Computed in {seconds:.0f} s.</p></body></html>\n'
    )
    (folder / "index.html").write_text(page, encoding="utf-8")
