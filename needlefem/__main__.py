"""``python -m needlefem``."""

from needlefem.cli.main import process

process()
