"""The stability suite: cases that try to make the solver fail, and a table of the results (``make stability``).

To add a group of cases, write a module here with a function ::

    def cases(*, short: bool) -> Iterator[Case]

and its name into ``groups.GROUPS``.  A ``Case`` has a name, a function ``run`` that gives a ``Finding`` (outcome,
solves, certificate, error against a reference), the outcomes that are right, the error that is allowed, a time limit
and a number of ranks.  Everything else (a process of its own that can be killed, the verdict, table, CSV, picture) is
done by ``runner``, ``case.judge`` and ``report``.  ``short`` asks for the few cheap cases that the tests run.

A case never raises on purpose: what it raises is a red row, as is a time limit that is passed, a crash, and a result
whose outcome is converged although it is wrong.
"""
