import numpy as np
import pytest
from skfem import MeshTet

from needlefem.errors import CaseError
from needlefem.mesh import box, check_entry, entry_along, entry_at


def test_first_crossing_of_a_straight_line() -> None:
    mesh = box((0, 0), (1, 1), (4, 4))
    found = entry_along(mesh, np.array([0.3, 0.6]), np.array([0.0, 1.0]))
    assert found is not None
    assert found.point == pytest.approx([0.3, 0.0])
    assert found.inward == pytest.approx([0.0, 1.0])


def test_oblique_line_and_line_that_misses() -> None:
    mesh = box((0, 0), (1, 1), (4, 4))
    direction = np.array([0.6, 0.8])
    found = entry_along(mesh, np.array([0.9, 0.8]), direction)
    assert found is not None
    assert found.point == pytest.approx([0.3, 0.0])
    assert entry_along(mesh, np.array([2.0, 0.5]), np.array([0.0, 1.0])) is None


def test_line_through_a_corner_vertex_is_decided() -> None:
    mesh = box((0, 0), (1, 1), (4, 4))
    found = entry_along(mesh, np.array([0.25, 0.5]), np.array([0.0, 1.0]))
    assert found is not None
    assert found.point == pytest.approx([0.25, 0.0])


def test_entry_in_three_dimensions() -> None:
    mesh = MeshTet().refined(2)
    found = entry_along(mesh, np.array([0.3, 0.4, 0.5]), np.array([0.0, 0.0, 1.0]))
    assert found is not None
    assert found.point == pytest.approx([0.3, 0.4, 0.0], abs=1e-12)
    assert found.inward == pytest.approx([0.0, 0.0, 1.0])


def test_point_off_the_skin_is_refused() -> None:
    mesh = box((0, 0), (1, 1), (4, 4))
    with pytest.raises(CaseError, match="is not on the skin; the needle's line enters"):
        entry_at(mesh, np.array([0.3, 0.1]), np.array([0.0, 1.0]))
    with pytest.raises(CaseError, match="misses the tissue"):
        entry_at(mesh, np.array([3.0, 0.0]), np.array([0.0, 1.0]))


def test_grazing_and_held_entries_are_refused() -> None:
    mesh = box((0, 0), (1, 1), (4, 4))
    flat = np.array([np.cos(0.1), np.sin(0.1)])
    found = entry_along(mesh, np.array([0.5, 0.02]), flat)
    assert found is not None
    with pytest.raises(CaseError, match="almost parallel to the skin"):
        check_entry(found, flat, np.array([], dtype=np.intp))
    straight = entry_along(mesh, np.array([0.3, 0.5]), np.array([0.0, 1.0]))
    assert straight is not None
    with pytest.raises(CaseError, match="is fixed by a support"):
        check_entry(straight, np.array([0.0, 1.0]), np.array([straight.facet]))
