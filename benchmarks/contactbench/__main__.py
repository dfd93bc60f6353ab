"""The command: ``python3 -m benchmarks.contactbench``."""

from __future__ import annotations

import sys

from benchmarks.contactbench.command import main

sys.exit(main())
