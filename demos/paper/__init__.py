"""The numerical results of Kunisch & Stadler (2005), section 7, computed anew and laid beside the printed ones.

``printed.json`` holds the printed numbers, ``scenes`` the two examples, ``laboratory`` what is measured on them,
``tables``, ``studies`` and ``figures`` one function for each table and figure, ``report`` how they are shown.
``demos/paper.py`` runs them.
"""
