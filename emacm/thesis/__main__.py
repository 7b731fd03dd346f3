"""``python -m emacm.thesis`` is ``python -m emacm reproduce``."""

import sys

from emacm.__main__ import main

sys.exit(main(["reproduce", *sys.argv[1:]]))
