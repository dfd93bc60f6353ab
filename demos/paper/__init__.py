"""The numerical results of Kunisch & Stadler (2005), section 7, computed anew and laid beside the
printed ones.

``printed.json`` holds the printed numbers, ``scenes`` the two examples, ``laboratory`` what is
measured on them, ``tables`` one function for each table, ``figures`` the scenes of the figures,
``report`` how tables are shown. ``demos/paper.py`` runs them.
"""
