"""``python -m emacm.thesis`` is ``python -m emacm reproduce``."""

import sys

from emacm.__main__ import run

run(["reproduce", *sys.argv[1:]])
