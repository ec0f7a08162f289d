"""A magnitude that makes no sense is out of range, whichever quantity it is."""

import shutil


from tests.conftest import CASES

MAGNITUDES = {
    "motion.speed": ("1e300 cm/s", "0 m/s", "-1 m/s", "nan m/s", "inf m/s", "1e-300 m/s"),
    "motion.max_depth": ("1e300 cm", "1e-300 cm", "0 cm"),
    "materials.fat.youngs_modulus": ("1e300 Pa", "1e-300 Pa", "0 Pa"),
    "materials.fat.density": ("1e300 kg/m^3",),
    "needle.cutting_force": ("1e300 N/m", "1e-300 N/m"),
    "needle.lateral_penalty": ("1e300 N/m^3",),
    "needle.static_friction_ratio": ("1e300",),
    "discretization.path_spacing": ("1e-300 m", "1e300 m"),
    "discretization.time_step": ("1e300 s",),
    "target.point": ('["1e300 m", "1 m"]',),
    "mesh.size": ('["1e300 m", "1 m"]',),
}




def test_no_magnitude_without_sense(folder, run):
    for part in ("gland", "tumour"):
        shutil.copy(CASES / "breast" / f"{part}.csv", folder / f"breast-{part}.csv")
    status, _, err = run("plan", "case.toml", "--json")
    assert status == 2
    assert err.startswith("needlefem: motion.speed: 1e+298 is out of range; ")
    for key, values in MAGNITUDES.items():
        for value in values:
            slow = ("--set", "motion.speed=1 cm/s") if key != "motion.speed" else ()
            status, _, err = run("run", "case.toml", *slow, "--set", f"{key}={value}")
            assert status == 2, (key, value)
            assert err.startswith(f"needlefem: {key}: "), err
            assert "out of range" in err, err
            assert len(err.splitlines()) == 1
