import pytest

from needlefem.errors import CaseError
from needlefem.units import UNITS, in_unit, parse_quantity


@pytest.mark.parametrize(
    ("text", "dimension", "value"),
    [
        ("1.27 mm", "length", 1.27e-3),
        ("60 kPa", "pressure", 60e3),
        ("92 N/m", "force per length", 92.0),
        ("-3e-1 cm", "length", -3e-3),
        (" 0.5 cm/s ", "speed", 5e-3),
    ],
)
def test_quantities(text: str, dimension: str, value: float) -> None:
    assert parse_quantity(text, dimension, "key") == pytest.approx(value, rel=1e-15)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("1 foot", "unknown unit 'foot'"),
        ("1 kPa", "is a pressure; a length is needed"),
        ("1", "has no unit"),
        (1.0, "has no unit"),
        ("one mm", "not a number"),
        ("1,5 mm", "write '1.5 mm'"),
        ("5mm", "write '5 mm'"),
        ("5\u00a0mm", "write '5 mm'"),
        ("1_0 mm", "digits 0 to 9"),
        ("\uff15 mm", "digits 0 to 9"),
    ],
)
def test_mistakes_name_key_value_and_remedy(text: object, says: str) -> None:
    with pytest.raises(CaseError, match="needle.tip_radius: .*") as caught:
        parse_quantity(text, "length", "needle.tip_radius")
    assert says in str(caught.value)


def test_every_unit_goes_there_and_back() -> None:
    for units in UNITS.values():
        for unit, factor in units.items():
            assert in_unit(factor, unit) == pytest.approx(1.0)
