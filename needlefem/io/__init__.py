"""Results in files: written, and read again."""
