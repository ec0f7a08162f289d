"""Reference problems: dynamics."""
