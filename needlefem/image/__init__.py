"""Label maps of scanners: read, cut by a plane, outlined."""
