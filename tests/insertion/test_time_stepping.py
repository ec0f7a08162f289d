"""A needle in any motion."""

from typing import Any

import numpy as np
import pytest

from needlefem import simulate
from needlefem.errors import CaseError
from needlefem.insertion import (
    STICK_CONDITION,
    Insertion,
    Simulation,
    Status,
    TipPhase,
    displacements,
    energy_terms,
)
from needlefem.materials import Viscoelastic
from needlefem.scene import Scene, Stage, vary

IN_AND_OUT = (Stage(depth=0.025), Stage(dwell=1.0, release="seed"), Stage(depth=-1e-3))


def moving(scene: Scene, *stages: Stage, **changes: object) -> Insertion:
    return simulate(vary(scene, {"motion.stages": stages, **changes}))


def kinds(insertion: Insertion) -> list[str]:
    return [event.kind for event in insertion.events]


def at(insertion: Insertion, depth: float, last: bool = False) -> int:
    found = np.flatnonzero(np.abs(insertion.depths - depth) < 1e-12)
    return int(found[-1 if last else 0])


@pytest.mark.parametrize("integrator", ["path_following", "quasi_static"])
def test_in_and_out(organ: Scene, integrator: str) -> None:
    found = moving(organ, *IN_AND_OUT, **{"discretization.integrator": integrator})
    assert found.outcome.status is Status.COMPLETED
    assert kinds(found) == [
        "puncture",
        "full_stick",
        "release",
        "retraction_start",
        "full_slip",
        "exit",
    ]
    last, seed = found.states[-1], found.seeds[0]
    assert last.tip_phase is TipPhase.OUTSIDE
    assert last.force == 0.0
    assert seed.inside
    assert last.seeds[0] == pytest.approx(seed.point, abs=1e-15)
    assert seed.released_at == pytest.approx([0.0287, 0.025])
    energies = energy_terms(found)
    assert energies.residual < 1e-12
    assert energies.largest_energy_gain < 1e-12
    assert energies.cutting > 0.0


def test_every_state_is_in_equilibrium(organ: Scene) -> None:
    """The full system, solved with the recorded forces, gives the tip's and the pieces' places."""
    found = moving(organ, *IN_AND_OUT)
    model, axis = found.model, found.axis
    for number in range(5, len(found.states), 9):
        state = found.states[number]
        field = model.nodal(displacements(found, [number])[:, 0])
        tip = state.tip + state.tip_weights @ field[state.tip_nodes]
        if state.tip_phase is not TipPhase.OUTSIDE:
            assert axis.axial_coordinate(tip) == pytest.approx(state.depth, abs=1e-10)
        for segment, lateral, moved in zip(
            state.filled(found.segments),
            state.lateral_force,
            state.segment_displacement,
            strict=True,
        ):
            mean = axis.frame @ (segment.weights @ field[segment.nodes])
            assert mean == pytest.approx(moved, abs=1e-10)
            assert mean[1:] + segment.compliance * lateral == pytest.approx(
                -segment.offset, abs=1e-9
            )


def test_friction_stays_within_its_limit_and_slips_at_it(organ: Scene) -> None:
    found = moving(organ, *IN_AND_OUT)
    stiffness = found.instrument.lateral_penalty
    for before, state in zip(found.states, found.states[1:], strict=False):
        if state.slipping is None or len(state.friction_force) < 2:
            continue
        segments = state.filled(found.segments)[1:]
        limit = organ.needle.shaft_friction / stiffness / np.array([p.compliance for p in segments])
        traction = state.friction_force[1:] / limit
        slipping = state.slipping[1:]
        assert np.all(np.abs(traction) <= 1.0 + 1e-9)
        assert traction[slipping != 0] == pytest.approx(slipping[slipping != 0], abs=1e-9)
        common = min(before.full_segments, state.full_segments)
        slip = (
            state.depth
            - before.depth
            - (
                state.segment_displacement
                - before.segment_displacement[: len(state.segment_displacement)]
            )[1:common, 0]
            if len(before.segment_displacement) >= len(state.segment_displacement)
            else None
        )
        if slip is not None:
            assert np.all(np.abs(slip[slipping[: common - 1] == 0]) < 1e-11)


def test_the_tip_cuts_only_forward_and_returns_to_its_front(organ: Scene) -> None:
    found = moving(organ, Stage(depth=0.02), Stage(depth=0.01), Stage(depth=0.03))
    assert {"puncture", "retraction_start", "recontact"} <= set(kinds(found))
    covered = np.array([state.inserted_length for state in found.states])
    ways = np.array([state.tip_phase for state in found.states])
    deep = at(found, 0.02)
    front = found.states[deep].tip
    drawn = ways == TipPhase.RETRACTED
    assert drawn.any()
    assert np.all(np.array([s.tip_force for s in found.states])[drawn] == 0.0)
    back = next(event for event in found.events if event.kind == "recontact")
    assert back.point == pytest.approx(front, abs=1e-12)
    assert covered[-1] > covered[deep]
    straight = moving(organ, Stage(depth=0.03), **{"discretization.integrator": "quasi_static"})
    assert found.states[-1].slipping.all()  # all that was turned round slips forward again
    assert found.tips[-1] == pytest.approx(straight.tips[-1], abs=1e-9)


def test_one_push_may_release_at_its_end(organ: Scene) -> None:
    found = moving(organ, Stage(depth=0.02, release="seed"))
    assert kinds(found) == ["puncture", "release"]
    assert found.states[-1].depth == 0.02
    assert found.seeds[0].point == pytest.approx(found.states[-1].tip)


def test_skin_that_is_only_pressed_springs_back(organ: Scene) -> None:
    found = moving(organ, Stage(depth=1e-3, release="seed"), Stage(depth=0.0))
    assert found.outcome.status is Status.COMPLETED
    assert kinds(found) == ["release"]
    assert not found.seeds[0].inside
    assert np.all(np.diff([state.time for state in found.states]) >= 0.0)
    assert found.states[-1].force == pytest.approx(0.0, abs=1e-9)
    assert energy_terms(found).residual < 1e-12


def test_a_hold_changes_nothing_in_elastic_tissue(organ: Scene) -> None:
    found = moving(organ, Stage(depth=0.02), Stage(dwell=5.0))
    first, last = found.states[at(found, 0.02)], found.states[-1]
    assert last.time == pytest.approx(first.time + 5.0)
    assert last.force == pytest.approx(first.force, rel=1e-9)
    assert not last.slipping.any()


def test_viscoelastic_tissue_relaxes_in_a_hold_and_comes_to_rest(gel: Scene) -> None:
    law = Viscoelastic(youngs_modulus=30e3, poissons_ratio=0.45, shares=(0.4,), times=(0.5,))
    stages = (
        Stage(depth=0.015),
        Stage(dwell=4.0, release="seed"),
        Stage(depth=-1e-3),
        Stage(dwell=20.0),
    )
    changes = {"materials": {"gel": law}, "discretization.time_step": 0.1}
    found = moving(gel, *stages, **changes)
    assert found.outcome.status is Status.COMPLETED
    begin, end = at(found, 0.015), at(found, 0.015, last=True)
    assert found.states[end].force < 0.95 * found.states[begin].force
    out = next(
        n for n, state in enumerate(found.states) if n > end and state.tip_phase is TipPhase.OUTSIDE
    )
    seed = found.seeds[0].point
    apart = [float(np.abs(state.seeds[0] - seed).max()) for state in found.states[out:]]
    assert apart[0] > 1e-7
    assert apart[-1] < 1e-9 * 0.015
    energies = energy_terms(found)
    assert energies.residual < 1e-9
    assert energies.largest_energy_gain < 1e-9
    assert energies.viscoelastic > 0.0


def test_a_train_is_laid_on_the_way_back(organ: Scene) -> None:
    stages = (
        Stage(depth=0.025),
        Stage(depth=0.005, seed_count=3, seed_spacing=0.005, release="seed"),
    )
    found = moving(organ, *stages, Stage(depth=-1e-3))
    assert [seed.name for seed in found.seeds] == ["seed 1", "seed 2", "seed 3"]
    depths = [seed.released_at[1] for seed in found.seeds]
    assert depths == pytest.approx([0.025, 0.020, 0.015])
    first, *others = found.seeds
    assert first.elastic_prediction == pytest.approx(first.point)
    for seed in others:  # friction turned round: the tissue comes along
        assert seed.point[1] > seed.elastic_prediction[1] + 1e-4
    rest = found.states[-1].seeds
    assert rest == pytest.approx(np.array([seed.point for seed in found.seeds]), abs=1e-15)


def test_a_table_is_a_motion(gel: Scene) -> None:
    table = {"motion.times": (0.0, 2.0, 3.0, 5.0), "motion.depths": (0.0, 0.012, 0.012, 0.004)}
    found = simulate(vary(gel, table))
    assert found.states[-1].depth == 0.004
    assert found.states[-1].time == pytest.approx(5.0)


def test_tissue_dragged_out_of_its_skin_springs_off(gel: Scene) -> None:
    soft = {"materials.gel.youngs_modulus": 12e3, "needle.shaft_friction": 12e3}
    found = moving(gel, Stage(depth=0.02), Stage(depth=-2e-3), **soft)
    leaving = next(event for event in found.events if event.kind == "exit")
    assert leaving.depth < 0.0
    assert leaving.energy > 0.0
    assert found.states[-1].tip_phase is TipPhase.OUTSIDE
    assert energy_terms(found).residual < 1e-12


def test_snap_and_puncture_are_events(popping: Scene) -> None:
    path_following = moving(popping)
    steps = moving(popping, **{"discretization.integrator": "quasi_static"})
    for found in (path_following, steps):
        assert kinds(found)[:2] == ["puncture", "rupture"]
    ours, theirs = steps.events[1], path_following.events[1]
    assert ours.depth == pytest.approx(theirs.depth, abs=1e-7)
    assert ours.point == pytest.approx(theirs.point, abs=1e-7)
    assert ours.energy == pytest.approx(theirs.energy, rel=1e-3)
    assert ours.energy == pytest.approx(energy_terms(steps).rupture)
    assert theirs.energy == pytest.approx(energy_terms(path_following).rupture)


def test_an_insertion_ends_where_cutting_would_give_energy(gel: Scene) -> None:
    """A needle that resticks in gel so soft that it folds over ahead of the tip."""
    soft = {"materials.gel.youngs_modulus": 3e3, "motion.max_depth": 0.045}
    found = simulate(vary(gel, soft))
    assert found.outcome.status is Status.NOT_CONVERGED
    assert "contact would add energy" in found.outcome.sentence
    assert energy_terms(found).largest_energy_gain <= 1e-9
    assert energy_terms(found).residual <= 1e-9


def test_what_rested_sticks_harder_and_weakens(gel: Scene) -> None:
    stages = (Stage(depth=0.02), Stage(dwell=1.0), Stage(depth=0.025))
    stiff = {"materials.gel.youngs_modulus": 60e3, "needle.shaft_friction": 5e3,
             "discretization.path_spacing": 2e-3}  # fmt: skip
    plain = moving(gel, *stages, **stiff)
    weak = {"needle.static_friction_ratio": 1.5, "needle.slip_weakening_distance": 5e-4}
    found = moving(gel, *stages, **stiff, **weak)
    restart = [
        max(state.force for state in each.states if 5.0 < state.time < 5.3)
        for each in (found, plain)
    ]
    assert restart[0] > 1.15 * restart[1]
    assert found.states[-1].force == pytest.approx(plain.states[-1].force, rel=1e-6)
    assert energy_terms(found).residual < 1e-12
    assert energy_terms(found).largest_energy_gain < 1e-9


FINE = {"discretization.path_spacing": 0.3e-3}
"""Segments of a tenth of an element: the mesh does not resolve rigid sticking on them."""


def test_what_sticks_on_short_segments_is_held_by_a_penalty(organ: Scene) -> None:
    simulation = Simulation(vary(organ, {**FINE, "motion.stages": IN_AND_OUT}))
    checks = {check.name: check for check in simulation.check()}
    assert checks["sticking segments"].passed
    found = simulation.sticking(simulation.entry_of_case())
    assert found.rigid_condition > STICK_CONDITION
    gives = organ.needle.shaft_friction / found.stiffness
    assert gives == pytest.approx(0.01 * organ.needle.tip_radius, rel=0.1)
    assert f"{found.stiffness:g} N/m^3" in simulation.reasons["tangential_penalty"]
    assert not any("alternates" in warning for warning in simulation.warnings)


def test_a_push_does_not_feel_the_penalty(organ: Scene) -> None:
    """Path following has none; time stepping has it, in whatever does not slip forward."""
    push = {**FINE, "motion.max_depth": 0.012}
    marched = simulate(vary(organ, push)).states[-1]
    stepped = simulate(vary(organ, push | {"discretization.integrator": "quasi_static"}))
    assert stepped.states[-1].force == pytest.approx(marched.force, rel=1e-9)
    assert stepped.states[-1].tip == pytest.approx(marched.tip, abs=1e-10)
    assert energy_terms(stepped).residual < 1e-12


def test_turning_back_on_short_segments_converges_with_the_penalty(organ: Scene) -> None:
    """The chosen penalty is stiff enough: ten times it changes force and seed little."""
    stages = Stage(depth=0.02, release="seed"), Stage(depth=0.012)
    chosen = moving(organ, *stages, **FINE)
    assert chosen.outcome.status is Status.COMPLETED
    assert energy_terms(chosen).residual < 1e-12
    assert energy_terms(chosen).largest_energy_gain < 1e-9
    stiffer = moving(organ, *stages, **FINE, **{"needle.tangential_penalty": 5e9})
    last, other = chosen.states[-1], stiffer.states[-1]
    deepest = max(state.force for state in chosen.states)
    assert abs(last.force - other.force) < 5e-3 * deepest
    assert np.linalg.norm(last.seeds - other.seeds) < 2e-5


def test_a_penalty_that_is_too_stiff_is_refused_with_one_that_is_not(organ: Scene) -> None:
    changes = {**FINE, "motion.stages": IN_AND_OUT, "needle.tangential_penalty": 1e18}
    with pytest.raises(
        CaseError, match=r"needle\.tangential_penalty: 1e\+18 is so stiff"
    ) as caught:
        Simulation(vary(organ, changes)).check()
    value = float(str(caught.value).rsplit("write ", 1)[1])
    simulation = Simulation(vary(organ, changes | {"needle.tangential_penalty": value}))
    assert all(check.passed for check in simulation.check())


@pytest.mark.parametrize(
    ("stages", "says"),
    [
        (({},), r"motion\.stages\[0\]: needs either 'depth' or 'dwell'"),
        ((Stage(depth=0.5),), "beyond motion.max_depth"),
        (
            (Stage(depth=0.02), Stage(depth=0.01, seed_count=5, seed_spacing=0.005)),
            "there is no space for 5 seeds",
        ),
        (({"dwell": 1.0, "speed": 1.0},), r"motion\.stages\[0\]\.speed: the needle rests"),
        (({"dwell": 1.0, "seed_count": 3},), r"motion\.stages\[0\]\.seed_count: the needle rests"),
        (
            ({"depth": 0.01}, {"depth": 0.02, "seed_spacing": 1e-3}),
            r"stages\[1\]\.seed_spacing: .* without 'seed_count'",
        ),
    ],
)
def test_motions_that_can_not_be(gel: Scene, stages: tuple[Any, ...], says: str) -> None:
    with pytest.raises(CaseError, match=says):
        moving(gel, *stages)


@pytest.mark.parametrize("prescribed", [False, True])
def test_quasi_static_steps_follow_the_path(paper_scene: Scene, prescribed: bool) -> None:
    """Full segments at the cost of path following; the same path with given time steps."""
    followed = Simulation(paper_scene)
    path = followed.insert(followed.entry_of_case())
    changes: dict[str, Any] = {"discretization.integrator": "quasi_static"}
    if prescribed:
        changes["discretization.time_step"] = 1.0
    stepped = Simulation(vary(paper_scene, changes))
    found = stepped.insert(stepped.entry_of_case())
    segments = len(found.segments)
    if prescribed:
        assert len(found.states) > 2 * segments
    else:
        assert found.contact_solves <= 5 * segments
    assert found.outcome.status == "completed"
    assert found.depths[-1] == path.depths[-1]
    nearest = np.linalg.norm(found.tips[:, None] - path.tips, axis=2).min(axis=0)
    assert nearest.max() <= 1e-10
    assert found.states[-1].force == pytest.approx(path.states[-1].force, rel=1e-9)


def test_seeds_are_released_at_the_ends_of_path_steps(organ: Scene) -> None:
    """A path step passes time steps, but neither the end of a stage nor a seed."""
    stages = (Stage(depth=0.011, release="one"), Stage(depth=0.0173, release="two"))
    found = simulate(vary(organ, {"motion.stages": stages}))
    assert [seed.name for seed in found.seeds] == ["one", "two"]
    assert found.depths[-1] == 0.0173
    assert np.any(found.depths == 0.011)
    times = np.array([state.time for state in found.states])
    assert np.all(np.diff(times) >= 0.0)
    speed = organ.motion.speed
    assert times == pytest.approx(found.depths / speed, abs=1e-9)
