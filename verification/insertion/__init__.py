"""Reference problems: insertion."""
