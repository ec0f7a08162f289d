"""Insertions of a needle into tissue, along the cut path or in time.

`Simulation` contains the data that all insertions of a scene share. An `Insertion` consists of
states, events, seeds and a status. Energies, displacements and the check of small strains are
computed from these states.
"""

from typing import TYPE_CHECKING

from needlefem._exports import lazy_exports

if TYPE_CHECKING:
    from needlefem.insertion.cut_path import TipPoint, TipTrajectory, TrajectoryInterval
    from needlefem.insertion.energy_balance import energy_terms
    from needlefem.insertion.insertion_run import InsertionRun, KeptStates, SaveAt
    from needlefem.insertion.motion_schedule import TimeStep
    from needlefem.insertion.path_following import PathFollowing
    from needlefem.insertion.response_in_time import DynamicResponse, ViscoelasticResponse
    from needlefem.insertion.result import (
        EnergyTerms,
        Event,
        Insertion,
        LeftTissueError,
        Outcome,
        Rupture,
        Seed,
        Status,
        StrainCheck,
        validity,
    )
    from needlefem.insertion.simulation import Discretised, Simulation, Watch, discretised
    from needlefem.insertion.state import State, TipPhase, displacements, load, loads
    from needlefem.insertion.sticking import STICK_CONDITION
    from needlefem.insertion.time_stepping import TimeStepping
    from needlefem.insertion.tissue_response import ElasticResponse, TissueResponse

__all__ = [
    "STICK_CONDITION",
    "Discretised",
    "DynamicResponse",
    "ElasticResponse",
    "EnergyTerms",
    "Event",
    "Insertion",
    "InsertionRun",
    "KeptStates",
    "LeftTissueError",
    "Outcome",
    "PathFollowing",
    "Rupture",
    "SaveAt",
    "Seed",
    "Simulation",
    "State",
    "Status",
    "StrainCheck",
    "TimeStep",
    "TimeStepping",
    "TipPhase",
    "TipPoint",
    "TipTrajectory",
    "TissueResponse",
    "TrajectoryInterval",
    "ViscoelasticResponse",
    "Watch",
    "discretised",
    "displacements",
    "energy_terms",
    "load",
    "loads",
    "validity",
]

if not TYPE_CHECKING:
    __getattr__, __dir__ = lazy_exports(
        __name__,
        cut_path="TipPoint TipTrajectory TrajectoryInterval",
        energy_balance="energy_terms",
        insertion_run="InsertionRun KeptStates SaveAt",
        motion_schedule="TimeStep",
        path_following="PathFollowing",
        response_in_time="DynamicResponse ViscoelasticResponse",
        result=(
            "EnergyTerms Event Insertion LeftTissueError Outcome Rupture Seed Status StrainCheck "
            "validity"
        ),
        simulation="Discretised Simulation Watch discretised",
        state="State TipPhase displacements load loads",
        sticking="STICK_CONDITION",
        time_stepping="TimeStepping",
        tissue_response="ElasticResponse TissueResponse",
    )
