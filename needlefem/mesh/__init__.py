"""Meshes: made, read, refined, fitted to contours, located in."""
