"""The entry point of ``python3 -m signorini_fx``, which runs the command ``signorini-fx``."""

import sys

from signorini_fx.scenes.cli import main

sys.exit(main())
