"""Where to release: searches over insertions, and studies of what they are worth."""
