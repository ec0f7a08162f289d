"""``needlefem info``."""

import argparse

from needlefem.cli.common import say, say_json
from needlefem.cli.installation import info, lines


def main(options: argparse.Namespace) -> int:
    """Print what is installed and what this runs on; return the exit status."""
    found = info()
    if options.json:
        say_json(found)
    else:
        say("\n".join(lines(found)))
    return 0
