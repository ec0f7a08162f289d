"""Reference problems: statics."""
