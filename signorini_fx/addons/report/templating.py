"""Templates of the page: whatever is put into them is escaped unless it is markup, and without control characters."""

from __future__ import annotations

from functools import cache
from importlib import resources
from typing import Any

from signorini_fx.errors import InstallationError
from signorini_fx.machine.terminal import printable

try:
    from jinja2 import Environment, FileSystemLoader, StrictUndefined
    from markupsafe import Markup as Markup
except ImportError:
    raise InstallationError("a report needs Jinja (pip install jinja2; on Debian: python3-jinja2)") from None

FOLDER = resources.files(__package__).joinpath("templates")


def _safe(value: Any) -> Any:
    return printable(value) if isinstance(value, str) and not isinstance(value, Markup) else value


@cache
def templates() -> Environment:
    """Those of this package."""
    environment = Environment(
        loader=FileSystemLoader(str(FOLDER)), autoescape=True, undefined=StrictUndefined, finalize=_safe
    )
    environment.filters["anchor"] = lambda heading: heading.lower().replace(" ", "-")
    return environment


def rendered(name: str, /, **values: Any) -> Markup:
    """A template with its values."""
    return Markup(templates().get_template(f"{name}.html").render(values).strip())


def part(name: str, *values: Any) -> Markup:
    """A macro of ``parts.html`` with its arguments."""
    macro = getattr(templates().get_template("parts.html").module, name)
    return Markup(macro(*values))
