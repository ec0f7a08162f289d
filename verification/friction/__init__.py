"""Reference problems: friction."""
