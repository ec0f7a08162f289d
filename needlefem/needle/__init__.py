"""The needle: its line, its tip, and contact in terms of the tissue's responses."""
