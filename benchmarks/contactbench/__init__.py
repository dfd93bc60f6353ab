"""Contact problems as plain text, their references, meshes, and a runner that judges
anybody's results.

Nothing here needs the package ``signorini_fx`` but the adapter that runs it: Python 3.11 and NumPy
are enough.
"""
