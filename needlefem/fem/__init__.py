"""The discretised tissue; scikit-fem is met here and in `elements` only."""
