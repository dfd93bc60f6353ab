"""The command: ``python3 -m contactbench``."""

from __future__ import annotations

import sys

from contactbench.command import main

sys.exit(main())
