"""``python -m needlefem``."""

import sys

from needlefem.cli.main import main

sys.exit(main())
