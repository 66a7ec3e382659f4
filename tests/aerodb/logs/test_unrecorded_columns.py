"""Columns that were not recorded, matrices under another name, and centres of gravity that no
aircraft has."""

import numpy as np
import pytest
import scipy.io

from aerodb.logs.mapping import choose_mapping, map_recording
from aerodb.storage.mappings import builtin_mappings
from aerodb.storage.readers.tabular import read_tabular
from aerodb.vehicle import parse_vehicle
from tests.support.command import asked
from tests.support.measured_flights import VEHICLE

TWIN_OTTER = "twin_otter/totter_f1_017_data.mat"
FEET = 0.3048


def matrix(seed=0, area=300.0, span=50.0, chord=6.0):
    """The 90 columns of `fdata`: a quiet flight with pitching and rolling motion."""
    rng = np.random.default_rng(seed)
    t = 10.0 + np.arange(500) / 50.0
    data = np.zeros((500, 90))
    data[:, 0] = t
    data[:, 1] = 200.0 + rng.normal(0, 0.2, 500)
    data[:, 3] = 4.0 + 2.0 * np.sin(2.0 * t)
    data[:, 4:7] = 5.0 * np.sin(np.outer(t, [1.1, 2.0, 0.7])) + rng.normal(0, 0.05, (500, 3))
    data[:, 7:9] = np.sin(np.outer(t, [0.5, 0.9]))
    data[:, 10:13] = np.array([0.05, 0.0, -1.0]) + rng.normal(0, 0.01, (500, 3))
    data[:, 13] = 2.0 * np.sin(2.0 * t)
    data[:, 26] = 40.0
    data[:, [44, 46]] = 205.0, 12.0
    data[:, 47:52] = 300.0, 2e4, 3e4, 4e4, 1e3
    data[:, 76:79] = area, span, chord
    return data


def mapped(path):
    recording = read_tabular(path)
    mapping = choose_mapping(recording, builtin_mappings().values())
    return mapping.name, map_recording(recording, mapping, parse_vehicle(VEHICLE))


@pytest.mark.parametrize("name", ["fdata", "fdata_run7", "manoeuvre"])
def test_matrix_is_read_under_any_name(tmp_path, name):
    path = tmp_path / "log.mat"
    scipy.io.savemat(path, {name: matrix(), "other": np.ones((4, 90)), "fs": 50.0})
    mapping, flight = mapped(path)
    assert mapping == "sidpac_fdata"
    assert flight["V"].mean() == pytest.approx(200.0 * FEET, rel=1e-3)
    assert flight["cg_x"][0] == pytest.approx(-205.0 * FEET / 12.0)


def test_measured_matrix_is_the_same_under_another_name(measured, tmp_path):
    content = scipy.io.loadmat(measured(TWIN_OTTER))
    path = tmp_path / "renamed.mat"
    scipy.io.savemat(path, {"totter": content["fdata"]})
    one, other = mapped(measured(TWIN_OTTER))[1], mapped(path)[1]
    assert set(one.channels) == set(other.channels)
    for name in one.channels:
        np.testing.assert_array_equal(one[name], other[name])


def test_table_of_ninety_columns_without_names_is_read(tmp_path):
    path = tmp_path / "log.csv"
    np.savetxt(path, matrix(), delimiter=",", fmt="%.9g")
    mapping, flight = mapped(path)
    assert mapping == "sidpac_fdata"
    assert np.ptp(flight["q"]) > 0.1


@pytest.mark.parametrize(
    "changed",
    [{"area": 0.0}, {"area": 3000.0}, {"span": -50.0}, "moving chord", "no time", "89 columns"],
)
def test_other_matrices_of_ninety_columns_are_no_fdata(tmp_path, changed):
    data = matrix(**(changed if isinstance(changed, dict) else {}))
    if changed == "moving chord":
        data[:, 78] += np.linspace(0.0, 0.1, len(data))
    elif changed == "no time":
        data[:, 0] = data[::-1, 0]
    elif changed == "89 columns":
        data = data[:, :89]
    path = tmp_path / "log.mat"
    scipy.io.savemat(path, {"manoeuvre": data})
    with pytest.raises(ValueError, match="no mapping fits"):
        mapped(path)


def test_zero_columns_are_named_with_their_remedy(tmp_path):
    path = tmp_path / "log.mat"
    scipy.io.savemat(path, {"fdata": matrix()})
    document = asked(tmp_path / "w", "log", "inspect", str(path))
    assert {"cg_y", "thrust", "rho", "beta"} <= set(document["zero"])
    assert not {"cg_x", "mass", "q"} & set(document["zero"])
    constant = [said for said in document["prevents"] if "[configuration]" in said]
    assert len(constant) == 1
    assert all(name in constant[0] for name in ("cg_y", "thrust", "rho"))
    assert "beta" not in constant[0]  # no constant stands for what moves
    assert any(
        said.startswith("beta") and "zero throughout" in said for said in document["prevents"]
    )


def test_zero_columns_of_a_measured_record(measured, tmp_path):
    document = asked(tmp_path / "w", "log", "inspect", str(measured(TWIN_OTTER)))
    assert {"delta_flap", "alphadot"} <= set(document["zero"])


@pytest.mark.parametrize(
    ("inches", "suspicious"), [(205.8, False), (1500.0, False), (42228.0, True)]
)
def test_centre_of_gravity_beyond_any_aircraft_is_suspicious(tmp_path, inches, suspicious):
    data = matrix()
    data[:, 44] = inches
    path = tmp_path / "log.mat"
    scipy.io.savemat(path, {"fdata": data})
    document = asked(tmp_path / "w", "log", "inspect", str(path))
    found = [each for each in document["suspicions"] if each["channel"] == "cg_x"]
    assert bool(found) == suspicious
    if suspicious:
        assert found[0]["kind"] == "unit"
        assert "1072.59 m from the datum" in found[0]["sentence"]


def test_centre_of_gravity_is_judged_by_the_size_of_the_vehicle(tmp_path):
    """21 m off the datum is no fault as such; it is one of an aircraft of 3 m span. So is a centre
    of gravity that travels by more than a chord."""
    data = matrix()
    data[:, 44] = 830.0
    data[:, 46] = np.linspace(0.0, 80.0, len(data))
    path = tmp_path / "log.mat"
    scipy.io.savemat(path, {"fdata": data})
    (tmp_path / "small.toml").write_text(
        VEHICLE.replace('"any"', '"small"').replace("span = 10.0", "span = 3.0"), encoding="utf-8"
    )
    root = tmp_path / "w"
    assert not [
        s for s in asked(root, "log", "inspect", str(path))["suspicions"] if "cg" in s["channel"]
    ]
    asked(root, "vehicle", "add", str(tmp_path / "small.toml"))
    (outcome,) = asked(root, "flight", "ingest", str(path), "--vehicle", "small", "--direct")
    said = {each["channel"]: each["sentence"] for each in outcome["suspicions"]}
    assert "further than this aircraft reaches (15 m)" in said["cg_x"]
    assert "travels by" in said["cg_z"]
