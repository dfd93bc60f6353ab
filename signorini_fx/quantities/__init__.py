"""Results: the name, value and unit of each, and where it is shown; some with derivatives and
bounds.
"""
