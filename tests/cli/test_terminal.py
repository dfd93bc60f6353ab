"""What a terminal shows: wrapped lines and colours; and that a pipe gets neither."""

import pytest

from signorini_fx.machine.terminal import TerminalLine

FIGURE = TerminalLine(
    "  what to do       ",
    "the load moves the body off its foundation and nothing else holds it: check the direction",
    "advice",
)


@pytest.mark.parametrize("width", [40, 60, 80, 200])
def test_prose_below_its_beginning(width):
    """No line is longer than the terminal, no word is lost, and prose continues where it began."""
    first, *others = FIGURE.broken(width, colours=False).split("\n")
    assert max(map(len, [first, *others])) <= width
    assert " ".join([first, *others]).split() == str(FIGURE).split()
    assert first.startswith("  what to do       the load")
    assert all(line[:19].isspace() and not line[19].isspace() for line in others)
    assert bool(others) == (len(str(FIGURE)) > width)


@pytest.mark.parametrize(("kind", "code"), [("error", 31), ("warning", 33), ("good", 32), ("", None)])
def test_colours(kind, code):
    """Errors, warnings and success; the text is the same without the escapes."""
    found = TerminalLine("certificate ", "holds", kind).broken(80, colours=True)
    assert found == ("certificate holds" if code is None else f"\x1b[{code};1mcertificate \x1b[0mholds")
