"""Test cases of other programs, run by this one: a table of their values and ours.

Each case is run in a process of its own, so that one that hangs or crashes is a row.  No other package imports it: an
add-on.
"""
