"""Tests of the problems, their references and the runner; pytest and meshio are enough."""
