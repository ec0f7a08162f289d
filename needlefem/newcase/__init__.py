"""First cases from anatomy in files: contours, label maps, meshes."""
