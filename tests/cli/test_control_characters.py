"""Control characters in titles and names reach no terminal, no page and no table."""

import pytest

from signorini_fx.addons.pictures.style import plain
from signorini_fx.addons.report.markup import part
from signorini_fx.machine import terminal
from signorini_fx.machine.display import html_table
from signorini_fx.machine.terminal import TerminalLine, printable
from signorini_fx.results.files import for_json

EVIL = "A\x1b[2J\x1b]0;title\x07\x9b31m\r\x00\u202ebeam"
CLEAN = "A31mbeam"


@pytest.mark.parametrize(
    "shown",
    [
        lambda: printable(EVIL),
        lambda: (
            TerminalLine(f"{EVIL}: ", EVIL).coloured().replace(": ", "").replace(CLEAN * 2, CLEAN)
        ),
        lambda: str(part("paragraph", EVIL)).removeprefix("<p>").removesuffix("</p>"),
        lambda: plain(EVIL),
        lambda: for_json({EVIL: [EVIL]})[CLEAN][0],
        lambda: html_table((), (), EVIL).partition("<caption>")[2].partition("</caption>")[0],
    ],
)
def test_one_rule(shown):
    """Escape sequences go as a whole, other control characters alone."""
    assert shown() == CLEAN


def test_what_stays():
    """Ends of lines, tabs, and all letters."""
    text = "Größe γ₁ \t 梁\nüber"
    assert printable(text) == text


def test_on_a_terminal(capsys):
    """What is printed: as a text, and as lines."""
    terminal.say(EVIL)
    terminal.say([TerminalLine(EVIL)], error=True)
    assert list(capsys.readouterr()) == [f"{CLEAN}\n", f"{CLEAN}\n"]
