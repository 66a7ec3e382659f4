"""Hinge moments of control surfaces in databases: prediction, files and back, differences."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from aerodb.errors import InputError
from aerodb.exchange import (
    export_csv,
    export_csv_table,
    export_daveml,
    export_jsbsim,
    export_mat,
    export_netcdf,
    from_document,
    import_csv,
    import_daveml,
    import_mat,
    import_netcdf,
    read_native,
    to_document,
)
from aerodb.nomenclature import AXES
from aerodb.tables import (
    AeroDatabase,
    Increment,
    Interval,
    diff,
    evaluate_database,
    make_check_cases,
    parse,
    total_coefficients,
)

SIX = """
name = "glider"
[reference]
area = 10.5
chord = 0.7
span = 15.0
moment_reference = [0.0, 0.0, 0.0]
[derivatives.CZ]
"1" = -0.25
alpha = -4.0
[derivatives.Cm]
delta_elevator = -1.2
"""
HINGES = """
[tables.CH_ALPHA]
arguments = ["alpha"]
breakpoints = [[-0.1, 0.0, 0.2]]
values = [0.03, 0.0, -0.05]
[[terms]]
name = "Ch_elevator_alpha"
axis = "Ch_elevator"
expression = "CH_ALPHA(alpha)"
[derivatives.Ch_elevator]
delta_elevator = -0.5
q_hat = -1.5
[derivatives.Ch_rudder]
delta_rudder = -0.3
"""


def _database() -> AeroDatabase:
    return read_native(SIX + HINGES)


def _updated() -> AeroDatabase:
    increment = Increment(
        axis="Ch_elevator",
        regressors=(parse("1"), parse("delta_elevator")),
        estimates=np.array([0.01, 0.1]),
        covariance=np.diag([1e-6, 1e-4]),
        envelope={
            "alpha": Interval(-0.05, 0.15, 0.1),
            "delta_elevator": Interval(-0.2, 0.2, 0.4),
        },
        flights=("one",),
    )
    return replace(_database(), increments=(increment,))


def _points(n: int = 200) -> dict[str, np.ndarray]:
    draw = np.random.default_rng(4)
    return {
        "alpha": draw.uniform(-0.3, 0.4, n),
        "delta_elevator": draw.uniform(-0.9, 0.9, n),
        "delta_rudder": draw.uniform(-0.5, 0.5, n),
        "q": draw.uniform(-0.5, 0.5, n),
        "V": draw.uniform(20.0, 60.0, n),
    }


def test_hinge_moments_are_predicted_beside_the_six_axes() -> None:
    at = _points()
    found = _database().predict(at).coefficients
    tabulated = np.interp(at["alpha"], [-0.1, 0.0, 0.2], [0.03, 0.0, -0.05])
    rate = at["q"] * 0.7 / (2.0 * at["V"])
    expected = tabulated - 0.5 * at["delta_elevator"] - 1.5 * rate
    np.testing.assert_allclose(found["Ch_elevator"], expected, rtol=0, atol=1e-15)
    np.testing.assert_allclose(found["Ch_rudder"], -0.3 * at["delta_rudder"], rtol=0, atol=1e-15)
    alone = read_native(SIX)
    assert (alone.axes, _database().axes) == (AXES, (*AXES, "Ch_elevator", "Ch_rudder"))
    for axis, values in alone.predict(at).coefficients.items():
        np.testing.assert_array_equal(values, found[axis])


def test_an_increment_adds_its_value_and_its_error() -> None:
    at = {name: np.zeros(1) for name in _points()} | {"V": np.ones(1)}
    at["delta_elevator"] = np.array([0.1])
    found = evaluate_database(_updated(), at)
    assert found.value["Ch_elevator"][0] == pytest.approx(-0.05 + 0.01 + 0.01)
    error = found.standard_error["Ch_elevator"][0]
    assert error == pytest.approx(np.hypot(1e-3, 0.1 * 1e-2))
    assert np.isnan(found.standard_error["Ch_rudder"][0])


def test_daveml_keeps_hinge_moments_and_their_increments() -> None:
    before = _updated()
    written = export_daveml(before)
    after = import_daveml(written)
    assert after.axes == before.axes
    for axis, values in before.predict(_points()).coefficients.items():
        again = after.predict(_points()).coefficients[axis]
        np.testing.assert_allclose(again, values, rtol=1e-12, atol=1e-12)
    # once more: the outputs are those of the import, and nothing is a second output
    assert import_daveml(export_daveml(after)).axes == before.axes
    # a file with the opposite sign of the moment
    turned = written.replace(b'units="nd" sign="ted"', b'units="nd" sign="teu"', 1)
    assert turned != written
    ch = import_daveml(turned).predict(_points()).coefficients["Ch_elevator"]
    np.testing.assert_allclose(ch, -before.predict(_points()).coefficients["Ch_elevator"])


@pytest.mark.parametrize(
    ("write", "read"),
    [
        (export_mat, import_mat),
        (export_csv, import_csv),
        (export_csv_table, import_csv),
        (export_netcdf, import_netcdf),
    ],
)
def test_files_of_arrays_keep_hinge_moments(
    write: Callable[[AeroDatabase], bytes], read: Callable[[bytes], AeroDatabase]
) -> None:
    before = _updated()
    after = read(write(before))  # it checks the check cases, on all axes
    assert to_document(after) == to_document(before)
    assert to_document(from_document(to_document(before))) == to_document(before)
    assert set(make_check_cases(before)[0].coefficients) == set(before.axes)


def test_jsbsim_has_them_as_functions_on_no_axis() -> None:
    text = export_jsbsim(_database(), name="glider").decode()
    assert text.index('name="aero/coefficient/Ch_rudder"') < text.index("<axis")


def test_a_simulation_flies_without_them() -> None:
    flown, alone = (total_coefficients(each) for each in (_updated(), read_native(SIX)))
    assert (flown.inputs, flown.estimates) == (alone.inputs, alone.estimates)


def test_a_difference_of_a_hinge_moment_is_found() -> None:
    found = diff(_database(), _updated())
    assert {change.axis for change in found.terms} == {"Ch_elevator"}
    (nodes,) = found.nodes
    assert (nodes.axis, nodes.grid.table) == ("Ch_elevator", "CH_ALPHA")
    np.testing.assert_allclose(nodes.change, 0.01)


@pytest.mark.parametrize("axis", ["CH_elevator", "Ch_", "Ch_Elevator"])
def test_an_axis_that_is_none_is_refused(axis: str) -> None:
    with pytest.raises(InputError, match=f"unknown axis '{axis}'"):
        read_native(f"{SIX}[derivatives.{axis}]\nalpha = 1.0\n")
