"""`python -m onecycle_lab ...`: the program `onecycle-lab`."""

import sys

from onecycle.__main__ import main

sys.exit(main("onecycle-lab"))
