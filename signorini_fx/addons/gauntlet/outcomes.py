"""What a case of another program has come to, as plain data.  No dolfinx here."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Self

# How a case ends, in the order of a summary.
WHOLE, LOST, REFUSED, UNSOLVED, SLOW, CRASHED, OTHER_KIND = (
    "whole",
    "something lost",
    "refused",
    "no solution",
    "out of time",
    "crashed",
    "another kind of problem",
)
STATES = (WHOLE, LOST, REFUSED, UNSOLVED, SLOW, CRASHED, OTHER_KIND)


@dataclass(frozen=True)
class ComparedQuantity:
    """A quantity that both programs have computed.

    Attributes:
        name: what and where, in words.
        theirs: the value where theirs is largest.
        ours: the value there.
        difference: the largest one of all values of the quantity, relative to the largest of theirs.
        exact: the value there; None: none is known.
        finer: by how much theirs and ours differ from our solution with all sides halved, relative to the largest of
            theirs; None: that was not asked for, or cannot be made.
    """

    name: str
    theirs: float
    ours: float
    difference: float
    exact: float | None = None
    finer: tuple[float, float] | None = None

    @property
    def nearer(self) -> str:
        """Whose values are nearer to the exact one, or to the solution on a finer mesh; "": it is not known."""
        if self.exact is not None:
            pair = abs(self.theirs - self.exact), abs(self.ours - self.exact)
        elif self.finer is not None:
            pair = self.finer
        else:
            return ""
        return "both" if pair[0] == pair[1] else "theirs" if pair[0] < pair[1] else "ours"


@dataclass(frozen=True)
class GauntletCase:
    """A case and what it has come to.

    Attributes:
        name: of its file.
        program: whose it is.
        state: one of ``STATES``.
        why: what is lost or refused, or how it ended.
        quantities: that both programs have.
        reasons: what explains differences, each found by a run.
        seconds: that it took.
    """

    name: str
    program: str
    state: str
    why: str = ""
    quantities: tuple[ComparedQuantity, ...] = ()
    reasons: tuple[str, ...] = ()
    seconds: float = 0.0

    @property
    def difference(self) -> float | None:
        """The largest one; None: nothing was compared."""
        return max((quantity.difference for quantity in self.quantities), default=None)

    def told_by_finer(self) -> Self:
        """The same with what the solution with all sides halved says of both values as a reason, where there is one."""
        shares = next((quantity.finer for quantity in self.quantities if quantity.finer is not None), None)
        if shares is None:
            return self
        theirs, ours = (100 * share for share in shares)
        reason = f"with sides half as long ours moves by {ours:.2g} %; theirs is {theirs:.2g} % from that"
        return replace(self, reasons=(*self.reasons, reason))

    def write(self, file: Path) -> None:
        """As JSON, in place of what is there."""
        part = file.with_suffix(".part")
        part.write_text(json.dumps(asdict(self)), encoding="utf-8")
        part.replace(file)

    @classmethod
    def read(cls, file: Path) -> Self:
        """Read what ``write`` has written."""
        data: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
        quantities = [
            ComparedQuantity(**quantity | {"finer": quantity["finer"] and tuple(quantity["finer"])})
            for quantity in data["quantities"]
        ]
        return cls(**data | {"quantities": tuple(quantities), "reasons": tuple(data["reasons"])})

    def ended(self, state: str, why: str, seconds: float) -> Self:
        """The same with another end, unless it had one."""
        return replace(self, state=state, why=why, seconds=seconds)


@dataclass(frozen=True)
class Gauntlet:
    """All cases of some folders.

    Attributes:
        cases: in the order of their names.
        sources: the folders, each with the commit that it is at, or "".
        seconds: that a case was given.
        date: when they were run.
    """

    cases: tuple[GauntletCase, ...]
    sources: tuple[tuple[str, str], ...]
    seconds: float
    date: str

    def counted(self, state: str) -> int:
        """How many cases have ended so."""
        return sum(case.state == state for case in self.cases)

    def within(self, share: float) -> int:
        """How many whole cases differ by no more than this."""
        return sum(
            case.state == WHOLE and case.difference is not None and case.difference <= share for case in self.cases
        )


def commit_of(folder: Path) -> str:
    """The commit of the git work tree that a folder is in; "": there is none."""
    for above in (folder.resolve(), *folder.resolve().parents):
        git = above / ".git"
        try:
            if git.is_file():
                git = (above / git.read_text(encoding="utf-8").partition("gitdir: ")[2].strip()).resolve()
            if not git.is_dir():
                continue
            head = (git / "HEAD").read_text(encoding="utf-8").strip()
            if not head.startswith("ref: "):
                return head
            name = head.removeprefix("ref: ")
            if (git / name).is_file():
                return (git / name).read_text(encoding="utf-8").strip()
            packed = (git / "packed-refs").read_text(encoding="utf-8").splitlines()
            return next((line.split()[0] for line in packed if line.endswith(f" {name}")), "")
        except OSError:
            return ""
    return ""


def in_short(remarks: Sequence[str], count: int = 3) -> str:
    """The first remarks in a line, and how many follow."""
    following = len(remarks) - count
    return "; ".join([*remarks[:count], *([f"and {following} more"] if following > 0 else [])])
