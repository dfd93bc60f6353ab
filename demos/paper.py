"""Recompute the numerical results of Kunisch & Stadler (2005): Tables 1 to 5 and Figures 2 to 9.

    ./env python3 demos/paper.py                              everything, into results/paper (make
    paper)
    ./env python3 demos/paper.py --tables 1 3 --json FILE     two of the tables, and their numbers
    as JSON

The work is done in the package ``paper`` beside this file.
"""

import sys

from paper.command import main

if __name__ == "__main__":
    sys.exit(main())
