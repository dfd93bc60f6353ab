"""The examples in the docstrings of the public names: each runs, and prints what it shows."""

import doctest
import inspect
import re
import textwrap

import pytest

import signorini_fx as sfx

# What has no docstring of its own: the annotation of a field.
WITHOUT = {"Parameter"}
NAMES = sorted(set(sfx.__all__) - WITHOUT)


@pytest.fixture(scope="module")
def beginning():
    """The names that the first lines define, which stand in the docstring of the package."""
    names = {}
    exec(textwrap.dedent(sfx.__doc__.partition("these lines::\n")[2]), names)
    return names


@pytest.mark.parametrize("name", NAMES)
def test_example(name, beginning, capsys, tmp_path, monkeypatch):
    """It has ten lines at most, and prints a number or a word; files are written elsewhere."""
    monkeypatch.chdir(tmp_path)
    thing = getattr(sfx, name)
    examples = doctest.DocTestParser().get_examples(inspect.cleandoc(thing.__doc__))
    assert examples, f"{name} has no example"
    assert sum(example.source.count("\n") for example in examples) <= 10
    assert re.search(r"\d|True", "".join(example.want for example in examples))
    assert not any(example.options for example in examples)
    test = doctest.DocTest(examples, dict(beginning), name, None, None, None)
    doctest.DocTestRunner(verbose=False).run(test, clear_globs=False)
    assert capsys.readouterr().out == ""
