"""The command: ``python3 -m contactbench``, or with the name of the folder above it."""

from __future__ import annotations

import sys

from .command import main

sys.exit(main())
