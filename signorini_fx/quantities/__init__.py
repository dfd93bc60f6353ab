"""Results: what each is in words, its value, its unit, and where it is shown; some with derivatives
and bounds.
"""
