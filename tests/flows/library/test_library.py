"""``import aerodb``: from a log to residuals, fits and versions in Python, as the commands have it."""

import math
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import aerodb
from aerodb.errors import InputError, UnknownNameError
from aerodb.increments import choose_hold_out
from aerodb.loop import Accept, freeze_library, run_loop
from aerodb.storage.catalogue.catalogue import Catalogue
from aerodb.tasks.steps.loop_flights import flights_of
from tests.support.command import asked
from tests.support.paths import ROOT
from tests.support.shared_workspace import SharedWorkspaces
from tests.support.small_glider import MODEL, NAME, TRUTH, channels, write_csv

#: What the flown glider has on CX, which errors of sensors explain as well.
ACCEPT = Accept(ambiguous=("zero_offset@CX", "alpha_slope@CX"))


@pytest.fixture(scope="module")
def folder(shared: SharedWorkspaces) -> Path:
    return shared.logs[0].parent


@pytest.fixture(scope="module")
def compared(shared: SharedWorkspaces, folder: Path) -> list[Any]:
    database = aerodb.load_database(folder / "database.toml")
    vehicle = aerodb.load_vehicle(folder / "vehicle.toml")
    measured = [
        aerodb.total_coefficients(aerodb.reconstruct(aerodb.load(log, vehicle)))
        for log in shared.logs
    ]
    return [aerodb.compare(each, database) for each in measured]


def test_import_waits_for_nothing_and_the_module_is_the_command() -> None:
    code = "import aerodb, sys; print(aerodb.__version__, 'numpy' in sys.modules, dir(aerodb)[-1])"
    said = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True
    ).stdout.split()
    assert said[1:] == ["False", "validate"]
    module = subprocess.run(
        [sys.executable, "-m", "aerodb", "--version"], cwd=ROOT, capture_output=True, text=True
    )
    assert module.stdout.split() == ["aerodb", said[0]]
    assert (Path(aerodb.__file__).parent / "py.typed").exists()
    with pytest.raises(AttributeError):
        _ = aerodb.no_such_name


def test_every_public_name_is_there_and_says_what_it_does() -> None:
    for name in aerodb.__all__:
        assert getattr(aerodb, name).__doc__, name


def test_a_flight_has_the_residuals_of_the_command(
    compared: list[Any], shared: SharedWorkspaces, tmp_path: Path
) -> None:
    workspace, _ = shared.updated(tmp_path / "w")
    ids = {each["flight"] for each in asked(workspace.root, "flight", "list")}
    one = compared[2]
    assert one.comparison.flight in ids
    command = asked(workspace.root, "flight", "compare", one.comparison.flight, "v0001")
    for axis, said in command["axes"].items():
        assert one.comparison.summary(axis) == pytest.approx(
            {name: math.nan if value is None else value for name, value in said.items()},
            rel=1e-12,
            nan_ok=True,
        ), axis
    opened = aerodb.open_workspace(workspace.root)
    again = aerodb.total_coefficients(aerodb.reconstruct(opened.log(one.comparison.flight)))
    for axis, values in one.measured.coefficients.values.items():
        np.testing.assert_array_equal(again.coefficients.values[axis], values)
    assert again.reconstructed.verdict == one.measured.reconstructed.verdict == "limited"


def test_a_fit_finds_what_was_planted_with_and_without_a_database(
    compared: list[Any], folder: Path
) -> None:
    fit = aerodb.fit(compared, folder / "model.toml")
    for axis, terms in TRUTH.items():
        for term, value in terms.items():
            found = fit[f"{axis}_{'0' if term == '1' else term}"]
            assert found.value == pytest.approx(value, abs=5 * found.standard_error)
    assert "[[regression]]" in fit.report()
    whole = aerodb.fit([each.measured for each in compared], MODEL)
    handbook = 0.4  # CX_alpha of the handbook
    truth = handbook + TRUTH["CX"]["alpha"]
    assert whole["CX_alpha"].value == pytest.approx(truth, abs=5 * whole["CX_alpha"].standard_error)
    frame = fit.to_pandas()
    assert frame.loc["CZ_alpha", "value"] == fit["CZ_alpha"].value


def test_views_hold_the_same_numbers(compared: list[Any]) -> None:
    one = compared[0]
    frame = one.to_pandas()
    np.testing.assert_array_equal(frame["CZ"]["residual"], one.residual("CZ"))
    assert frame.index.name == "time"
    log = one.measured.reconstructed.log
    assert log.to_pandas().attrs["units"]["alpha"] == "rad"
    topic = log.topic("table")
    assert topic.attrs["units"]["alpha"] == "rad"
    np.testing.assert_array_equal(log.to_pandas()["alpha"], topic["alpha"])
    with pytest.raises(UnknownNameError, match="tabel"):
        log.topic("tabel")
    for result in (log, one.measured.reconstructed, one.measured, one):
        assert result.report().startswith("[[")
        assert result._repr_html_().startswith("<strong>")
        assert len(result.to_pandas()) == len(log.flight.time)


def test_xarray_carries_units_and_axes(compared: list[Any]) -> None:
    pytest.importorskip("xarray")
    data = compared[0].to_xarray()
    assert data["residual"].dims == ("axis", "time")
    assert data["time"].attrs["units"] == "s"
    np.testing.assert_array_equal(data["residual"].sel(axis="CZ"), compared[0].residual("CZ"))
    channel = compared[0].measured.reconstructed.to_xarray()["alpha"]
    assert channel.attrs == {
        "units": "rad",
        "long_name": "angle of attack atan2(w, u) of the air-relative velocity at the CG",
    }


def test_a_notebook_shows_names_of_files_as_text(folder: Path, tmp_path: Path) -> None:
    hostile = write_csv(tmp_path / "<img src=x onerror=alert(1)>.csv", channels(1))
    shown = aerodb.load(hostile, folder / "vehicle.toml")._repr_html_()
    assert "<img" not in shown
    assert "&lt;img" in shown


def test_a_version_is_evaluated_with_units(
    shared: SharedWorkspaces, folder: Path, tmp_path: Path
) -> None:
    workspace, _ = shared.updated(tmp_path / "w")
    opened = aerodb.open_workspace(workspace.root)
    assert opened.vehicles == (NAME,)
    assert len(opened.flights()) == 6
    assert list(opened.versions().index) == ["v0001", "v0002"]
    version = opened.version("candidate")
    assert "declared: CZ, CX" in version._repr_html_()
    assert "v0002</td>" in opened._repr_html_()
    points = version.evaluate(units={"alpha": "deg"}, alpha=[0.0, 4.0], q=0.1, V="90 km/h")
    said = asked(
        workspace.root, "version", "evaluate", "candidate", "--at", "alpha=4deg,q=0.1,V=90km/h"
    )
    axes = said["coefficients"]
    for axis, value in axes.items():
        assert points[axis][1] == value
    assert points.assumed == ("beta", "delta_elevator", "p")
    assert points.to_pandas().index.name == "alpha"
    handbook = aerodb.evaluate(aerodb.load_database(folder / "database.toml"), alpha="0 rad")
    assert handbook["CZ"][0] == -0.3


def test_tables_of_a_workspace_show_what_one_looks_at_first_and_have_everything(
    shared: SharedWorkspaces, tmp_path: Path
) -> None:
    opened = aerodb.open_workspace(shared.ingested(tmp_path / "w").root)
    flights = opened.flights()
    shown = flights._repr_html_()
    assert f"<th>{flights.index[0][:12]}</th>" in shown
    assert "<td>flight1.csv</td>" in shown
    assert "<th>mapping</th>" not in shown
    assert "further columns: vehicle, samples, mapping, reasons, retracted" in shown
    printed = str(flights).splitlines()
    assert len(printed) <= len(flights) + 4
    assert "flight1.csv" in "".join(printed)
    assert printed[-1].startswith("further columns: vehicle, samples, mapping")
    assert "canonical" in str(flights[["mapping", "file"]])
    assert set(flights.mapping) == {"canonical"}
    assert "<th>mapping</th>" in flights[["mapping", "file"]]._repr_html_()
    assert list(opened.versions()["version"]) == [opened.version("v0001").id]


def test_what_cannot_be_done_is_said(compared: list[Any], folder: Path, tmp_path: Path) -> None:
    database = compared[0].database
    with pytest.raises(InputError, match="no such file"):
        aerodb.load(tmp_path / "absent.ulg", folder / "vehicle.toml")
    (tmp_path / "empty.ulg").write_bytes(b"")
    with pytest.raises(InputError, match=r"empty\.ulg"):
        aerodb.load(tmp_path / "empty.ulg", folder / "vehicle.toml")
    with pytest.raises(InputError, match="cannot be read"):
        aerodb.load_database(tmp_path / "absent.toml")
    with pytest.raises(UnknownNameError, match="alpha"):
        aerodb.evaluate(database, alhpa=1.0)
    with pytest.raises(InputError, match="shapes"):
        aerodb.evaluate(database, alpha=[1.0, 2.0], q=[1.0, 2.0, 3.0])
    with pytest.raises(InputError, match="not finite"):
        aerodb.evaluate(database, alpha=np.nan)
    with pytest.raises(InputError, match="no flights"):
        aerodb.trace([])
    with pytest.raises(InputError, match="there twice"):
        aerodb.trace([compared[0], compared[0]])
    other = aerodb.load_database(folder / "database.toml", {})
    changed = aerodb.compare(compared[1].measured, type(other)("other", other.reference))
    with pytest.raises(InputError, match="different databases"):
        aerodb.trace([compared[0], changed])
    with pytest.raises(InputError, match="no method"):
        aerodb.fit(compared, MODEL, "regresion")
    with pytest.raises(InputError):
        aerodb.open_workspace(tmp_path / "nowhere")


@pytest.fixture(scope="module")
def traced(compared: list[Any]) -> Any:
    return aerodb.trace(compared, accept=ACCEPT)


def test_flights_in_memory_are_traced_as_those_of_a_workspace(
    traced: Any, compared: list[Any], shared: SharedWorkspaces, tmp_path: Path
) -> None:
    workspace, _ = shared.updated(tmp_path / "w")
    with Catalogue.open(workspace.catalogue) as catalogue:
        run = catalogue.start_run("close_loop_flow", how="direct", parameters={}).id
    source = flights_of(str(workspace.root), NAME, run)
    split = choose_hold_out([each.comparison.flight for each in compared], {})
    baseline = aerodb.open_workspace(workspace.root).version("v0001").database
    library = freeze_library(source, split.identified, baseline)
    said = run_loop(source, split.identified, baseline, library, ACCEPT)
    assert library.sha256 == traced.library_sha256
    assert said.findings == traced.findings
    assert said.added == traced.loop.added


def test_what_is_traced_is_shown_with_its_worth(traced: Any) -> None:
    assert {"CX", "Cm"} <= {axis for each in traced.findings for axis in each.axis}
    assert list(traced.to_pandas().index) == [each.hypothesis for each in traced.findings]
    assert "6 flights beside handbook" in traced.report()
    cx = next(each for each in traced.validation if each.axis == "CX")
    assert cx.held_out_rms_after < 0.4 * cx.held_out_rms_before
    assert "Cm: not corrected as a whole" in traced.report()  # its control would be reversed
    assert len(traced.candidate.increments) == 1


def test_nothing_more_is_found_beside_the_candidate(traced: Any, compared: list[Any]) -> None:
    again = aerodb.trace([aerodb.compare(each.measured, traced.candidate) for each in compared])
    known = {each.hypothesis for each in traced.loop.added}
    assert not known & {each.hypothesis for each in again.loop.added}
