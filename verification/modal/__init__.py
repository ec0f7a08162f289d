"""Reference problems: modal."""
