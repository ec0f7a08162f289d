"""What several reference problems share."""
