"""Reference problems: rejects."""
