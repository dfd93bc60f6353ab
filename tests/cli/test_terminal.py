"""What a terminal shows: colours."""

import pytest

from signorini_fx.machine.terminal import TerminalLine


@pytest.mark.parametrize(
    ("kind", "code"), [("error", 31), ("warning", 33), ("good", 32), ("", None)]
)
def test_colours(kind, code):
    """Errors, warnings and success; the text is the same without the escapes."""
    found = TerminalLine("certificate ", "holds", kind).coloured()
    assert found == (
        "certificate holds" if code is None else f"\x1b[{code};1mcertificate \x1b[0mholds"
    )
