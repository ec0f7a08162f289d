"""Stress tests: random valid scenes and damaged input files, drawn from seeds.

`scenes` draws scenes that must be simulated or planned without any fault; `inputs` damages case
files, contours, meshes, label maps and result folders, which must be answered by a sentence.
"""
