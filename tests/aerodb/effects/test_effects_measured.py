"""The effect library on measured flight: the defects of DHC6.xml that the Twin Otter's lateral
record exposes."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from aerodb.coefficients.comparison import band_limited, compare
from aerodb.coefficients.total import total_coefficients
from aerodb.effects.flight_view import FlightView, view_of
from aerodb.effects.hypothesis import Hypothesis
from aerodb.effects.library import hypotheses_for
from aerodb.logs.mapping import choose_mapping, map_recording
from aerodb.signals.error_measures import rms
from aerodb.storage.mappings import builtin_mappings
from aerodb.storage.readers.tabular import read_tabular
from aerodb.vehicle import parse_vehicle
from tests.aerodb.increments.test_measured_update import twin_otter_database
from tests.support.paths import VEHICLES


@pytest.fixture(scope="module")
def otter(
    measured: Callable[[str], Path],
) -> tuple[FlightView, dict[str, Hypothesis], dict[str, np.ndarray]]:
    """View, library and residuals of the lateral Twin Otter record beside DHC6.xml."""
    vehicle = parse_vehicle((VEHICLES / "twin_otter.toml").read_text())
    recording = read_tabular(measured("twin_otter/totter_f1_017_data.mat"))
    flight = map_recording(
        recording, choose_mapping(recording, builtin_mappings().values()), vehicle, "f1_017"
    )
    database = twin_otter_database()
    compared = compare(flight, total_coefficients(flight, vehicle), database, vehicle.reference)
    view = view_of(flight, compared, database, vehicle)
    library = {item.id: item for item in hypotheses_for(database, vehicle, flight.channels)}
    return view, library, {axis: compared.residual(axis) for axis in ("Cl", "Cn")}


def _fit(
    otter: tuple[FlightView, dict[str, Hypothesis], dict[str, np.ndarray]], axis: str, *extra: str
) -> tuple[float, dict]:
    """rms and estimates with the linear set of SOURCE.md and what is named."""
    view, library, residual = otter
    rates = (
        ["roll_damping@Cl", "cross_rate@Cl:r"]
        if axis == "Cl"
        else ["cross_rate@Cn:p", "yaw_damping@Cn"]
    )
    names = [
        f"beta_slope@{axis}",
        *rates,
        *(f"control_effectiveness@{axis}:{s}" for s in ("aileron", "rudder")),
        *extra,
    ]
    columns = [
        band_limited(library[name].columns(view)[axis], view.step, view.bandwidth) for name in names
    ]
    design = np.column_stack([np.ones(len(view.time)), *columns])
    estimates = np.linalg.lstsq(design, residual[axis], rcond=None)[0]
    return rms(residual[axis] - design @ estimates), dict(
        zip(["1", *names], estimates, strict=True)
    )


def test_the_twin_otters_defects_have_their_templates(otter) -> None:
    """data/twin_otter/SOURCE.md: Cl .0121 with linear increments, .0008 once the table's own column
    is in; Cn_beta about .42 too large; an alpha*beta increment near -4.6."""
    view, library, _ = otter
    assert _fit(otter, "Cl")[0] > 0.011
    repaired, estimates = _fit(otter, "Cl", "table_sign@Cl:Clb")
    assert repaired < 0.0009
    assert estimates["table_sign@Cl:Clb"] == pytest.approx(-1.0, abs=0.05)
    assert _fit(otter, "Cl", "beta_even@Cl")[0] < 0.0009
    table, even = (
        library[name].columns(view)["Cl"] for name in ("table_sign@Cl:Clb", "beta_even@Cl")
    )
    assert np.corrcoef(table, even)[0, 1] > 0.999
    yaw, estimates = _fit(otter, "Cn", "sideslip_coupling@Cn")
    assert yaw < 0.0005 < _fit(otter, "Cn")[0]
    assert estimates["beta_slope@Cn"] == pytest.approx(0.085 - 0.50, abs=0.04)
    assert estimates["sideslip_coupling@Cn"] == pytest.approx(-4.6, abs=0.5)
    for name in ("table_sign@Cl:Clb", "beta_slope@Cn", "sideslip_coupling@Cn"):
        low, high = library[name].plausible
        value = {**_fit(otter, "Cl", "table_sign@Cl:Clb")[1], **estimates}[name]
        assert low < value < high
