"""Mutants are drawn on the lines of a change, and tried by the tests that run them."""

from benchmarks.stability import drawn

DIFF = """\
--- a/signorini_fx/algebra/contact/laws.py
+++ b/signorini_fx/algebra/contact/laws.py
@@ -3,0 +4,2 @@ def f
+one
+two
@@ -9 +12 @@
-old
+new
@@ -20,2 +22,0 @@
--- a/signorini_fx/notes.txt
+++ b/signorini_fx/notes.txt
@@ -1 +1 @@
"""


class Negated:
    """An operator as cosmic-ray has them: names get a sign."""

    def mutation_positions(self, node):
        return [(node.start_pos, node.end_pos)] if node.type == "name" else []

    def mutate(self, node, index):
        node.value = f"-{node.value}"
        return node


def test_drawn_mutants():
    """On the lines of a change, one for each expression, and none where mutants show nothing."""
    assert drawn.touched(DIFF) == {"signorini_fx/algebra/contact/laws.py": {4, 5, 12}}
    source = "a = b\ndef f(c: d) -> e:\n    if c < g:\n        raise k(m)\n    return c\n"
    found = drawn.mutants("x.py", source, {1, 2, 3, 4}, {"negated": Negated()}, drawn.random.Random(0))
    assert [(m.line, m.in_function) for m in found] == [(1, False)] * 2 + [(2, False)] * 2 + [(3, True)] * 2
    assert found[-1].source == source.replace("g:", "-g:")
    assert found[-1].change == "-     if c < g:\n+     if c < -g:"
    assert drawn.between_operands("def f(*, c):\n    return g(*c, a * b)") == [((2, 18), (2, 21))]
    assert drawn.rooms(["signorini_fx/algebra/contact/laws.py", "signorini_fx/mechanics/scales.py"]) == [
        "tests/contact",
        "tests/verification",
    ]
    assert drawn.cheapest([("a", 9.0), ("b", 1.0), ("c", 4.0)], 6.0) == ["b", "c"]
    assert drawn.cheapest([("a", 9.0)], 6.0) == ["a"]
