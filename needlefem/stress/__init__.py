"""Stress tests: random valid scenes and damaged input files, drawn from seeds.

`run_scenes` draws scenes that must be simulated or planned without any fault. `run_inputs` damages
case files, contours, meshes, label maps and result folders, which must be answered by a sentence.
"""

from typing import TYPE_CHECKING

from needlefem._exports import lazy_exports

if TYPE_CHECKING:
    from needlefem.stress.draw import draw_case
    from needlefem.stress.drawncase import DrawnCase, DrawnQuantity, Units, in_units
    from needlefem.stress.inputfiles import (
        make_results,
        write_case,
        write_drawn_case,
        write_mesh_case,
    )
    from needlefem.stress.inputruns import check_input
    from needlefem.stress.inputs import run_inputs
    from needlefem.stress.pool import Lost, WorkerLimits, work_through
    from needlefem.stress.scenes import SceneAnswer, SceneRun, faults_of, run_scenes
    from needlefem.stress.symmetry import distance, turned_mesh, turned_scene

__all__ = [
    "DrawnCase",
    "DrawnQuantity",
    "Lost",
    "SceneAnswer",
    "SceneRun",
    "Units",
    "WorkerLimits",
    "check_input",
    "distance",
    "draw_case",
    "faults_of",
    "in_units",
    "make_results",
    "run_inputs",
    "run_scenes",
    "turned_mesh",
    "turned_scene",
    "work_through",
    "write_case",
    "write_drawn_case",
    "write_mesh_case",
]

if not TYPE_CHECKING:
    __getattr__, __dir__ = lazy_exports(
        __name__,
        draw="draw_case",
        drawncase="DrawnCase DrawnQuantity Units in_units",
        inputfiles="make_results write_case write_drawn_case write_mesh_case",
        inputruns="check_input",
        inputs="run_inputs",
        pool="Lost WorkerLimits work_through",
        scenes="SceneAnswer SceneRun faults_of run_scenes",
        symmetry="distance turned_mesh turned_scene",
    )
