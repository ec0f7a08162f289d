"""Contours and the frame between images and the plane of a scene."""
