"""The machine: ranks, the launcher, versions and requirements, the terminal, the compiler, and files in text.

These modules do not know what is solved, or how.
"""
