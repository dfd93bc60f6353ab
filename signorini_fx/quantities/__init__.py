"""Results by their names: what each is in words, its value, its unit, its derivative, its bound, and where it is shown.

A file of the folder ``families`` has those of one kind.  Others look up the registry and must not know one by its name.
"""
