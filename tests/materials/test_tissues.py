import pytest

from needlefem.casefile.reader import CaseReader
from needlefem.errors import CaseError
from needlefem.materials import Material, library, tissue_table, volumetric_split


@pytest.mark.parametrize("name", library())
def test_every_tissue_is_a_law(name: str, tmp_path) -> None:
    material = CaseReader(2, tmp_path).material({"tissue": name}, "x")
    assert isinstance(material, Material)
    assert 0.3 < volumetric_split(material).poissons_ratio < 0.5
    entry = library()[name]
    assert entry.get("range")
    assert entry.get("source") or entry.get("note")


def test_keys_of_the_case_win(tmp_path) -> None:
    reader = CaseReader(2, tmp_path)
    changed = reader.material({"tissue": "liver", "poissons_ratio": 0.45}, "x")
    assert changed.poissons_ratio == 0.45
    assert changed.youngs_modulus == pytest.approx(5400.0)


def test_unknown_tissue_is_answered_with_the_nearest() -> None:
    with pytest.raises(CaseError, match="no tissue 'livr'; did you mean 'liver'"):
        tissue_table("livr", "materials.x.tissue")
