"""Results in Python: what print says, plots into one's own axes, files, updates and validation beside
tracing, and errors by name."""

import re
import tomllib
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
import pandas as pd
import pytest

import aerodb
from aerodb.errors import InputError
from tests.flows.library.test_library import compared, folder
from tests.support.command import asked
from tests.support.console_workspace import TOKEN, served
from tests.support.shared_workspace import SharedWorkspaces
from tests.support.small_glider import MODEL, NAME, TRUTH
from tests.support.terminal import MOST_LINES, on_terminal

matplotlib.use("Agg")
__all__ = ["compared", "folder"]


@pytest.fixture(scope="module")
def updated(compared: list[Any]) -> Any:
    return aerodb.update(compared, tomllib.loads(MODEL))


@pytest.fixture(scope="module")
def results(compared: list[Any], updated: Any) -> list[Any]:
    one = compared[0]
    return [
        one.measured.reconstructed.log,
        one.measured.reconstructed,
        one.measured,
        one,
        aerodb.fit(compared, MODEL),
        updated,
        aerodb.trace(compared),
        aerodb.validate(compared[4:], updated),
        aerodb.evaluate(one.database, alpha=[0.0, 0.1], V=25.0),
    ]


def test_print_says_the_verdict_in_a_few_lines(results: list[Any]) -> None:
    for result in results:
        lines = str(result).splitlines()
        assert 2 <= len(lines) <= 10, lines
        assert lines[-1] == "  all of it: report(), plot(), to_pandas()"
        assert "-v" not in str(result).split()
        assert result._repr_html_().startswith("<strong>")
        assert len(result.report()) > 100 or not result.summary().rows
    assert "(6 flights)" in str(results[5]).splitlines()[0]
    assert "on 2 flights not used: error of CZ" in str(results[5])
    assert str(results[7]).startswith("candidate: no manoeuvre of 2 flights could be judged\n")


def test_an_update_is_that_of_the_command(
    updated: Any, shared: SharedWorkspaces, tmp_path: Path
) -> None:
    _, document = shared.updated(tmp_path / "w")
    ours = updated.document
    for key in ("axes", "increments", "flights"):
        assert _numbers(ours[key]) == pytest.approx(_numbers(document[key]), rel=1e-9, abs=1e-15), (
            key
        )
    frame = updated.to_pandas()
    for axis, terms in TRUTH.items():
        for term, value in terms.items():
            low, high = frame.loc[f"{axis} {term}", "low"], frame.loc[f"{axis} {term}", "high"]
            assert low - (high - low) < value < high + (high - low), (axis, term)


def _numbers(found: Any) -> list[float]:
    if isinstance(found, dict):
        return [x for key in sorted(found) for x in _numbers(found[key])]
    if isinstance(found, list):
        return [x for each in found for x in _numbers(each)]
    return [float(found)] if isinstance(found, (int, float)) else []


def test_a_model_is_a_file_its_text_or_a_dict(compared: list[Any], folder: Path) -> None:
    given = (folder / "model.toml", MODEL, tomllib.loads(MODEL))
    found = [aerodb.fit(compared, model)["CZ_alpha"].value for model in given]
    assert len(set(found)) == 1
    with pytest.raises(aerodb.InputError, match="increment"):
        aerodb.update(compared, {"increments": []})


def test_an_update_by_another_method_and_with_flights_held_out(compared: list[Any]) -> None:
    made = aerodb.update(compared, MODEL, hold_out=compared[:1], method="total-least-squares")
    assert made.hold_out.held_out == (compared[0].measured.flight.id,)
    assert made.method in str(made.report())
    with pytest.raises(aerodb.InputError, match="no method 'regresion'"):
        aerodb.update(compared, MODEL, method="regresion")


def test_intervals_of_a_fit_are_said_to_be_narrower_than_those_of_an_update(
    compared: list[Any], updated: Any
) -> None:
    fit = aerodb.fit(compared, MODEL)
    assert "those of update include them" in str(fit)
    assert "those of update include them" in fit.report()
    wide = {
        f"{axis.axis}_{'0' if name == '1' else name}": error
        for axis in updated.estimates.axes
        for name, error in zip(axis.names, axis.standard_errors, strict=True)
    }
    assert all(fit[name].standard_error < error for name, error in wide.items())


def test_plots_take_axes_and_give_them_back(results: list[Any]) -> None:
    from matplotlib import pyplot

    names = [("alpha", "theta")[:1], ("alpha",), ("CZ",), ("CZ", "CX"), (), (), (), (), ("CZ",)]
    for result, shown in zip(results, names, strict=True):
        figure, panel = pyplot.subplots()
        given = result.plot(*shown, ax=panel)
        assert given is panel
        assert panel.get_title()
        figure.canvas.draw()
        pyplot.close(figure)
    log = results[0]
    panel = log.plot("alpha")
    drawn = panel.get_lines()[0].get_ydata()
    np.testing.assert_allclose(drawn, np.rad2deg(log.flight["alpha"]))
    assert panel.get_ylabel() == "[deg]"
    with pytest.raises(aerodb.UnknownNameError, match="did you mean 'alpha'"):
        log.plot("alhpa")
    with pytest.raises(aerodb.UnknownNameError, match="CZ_alpha"):
        results[4].plot("CZ_alpa")
    pyplot.close("all")


def test_what_is_saved_is_read_back_with_its_arrays_and_candidate(
    results: list[Any], tmp_path: Path
) -> None:
    for k, result in enumerate(results):
        again = aerodb.load_result(result.save(tmp_path / f"{k}.aerodb"))
        assert again.kind == type(result).__name__
        assert (str(again), again.report()) == (str(result), result.report())
        assert again.to_pandas().equals(result.to_pandas())
        assert again._repr_html_() == result._repr_html_()
        assert aerodb.load_result(again.save(tmp_path / "twice")).kind == again.kind
    candidate = aerodb.load_result(tmp_path / "5.aerodb").candidate
    assert candidate is not None
    point = {"alpha": 0.05, "V": 25.0}
    np.testing.assert_array_equal(
        aerodb.evaluate(candidate, **point)["CZ"],
        aerodb.evaluate(results[5].candidate, **point)["CZ"],
    )


@pytest.mark.parametrize("content", [b"", b"PK\x03\x04 no zip", b"{}"])
def test_a_file_that_is_no_result_is_refused(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "x"
    path.write_bytes(content)
    with pytest.raises(InputError, match="not a saved result"):
        aerodb.load_result(path)
    with pytest.raises(InputError, match="check its name"):
        aerodb.load_result(tmp_path / "none")
    with pytest.raises(aerodb.StoreError, match="choose another path"):
        aerodb.evaluate(aerodb.load_database(_database(tmp_path))).save(tmp_path / "no" / "x")


def _database(folder: Path) -> Path:
    from tests.support.small_glider import DATABASE

    path = folder / "database.toml"
    path.write_text(DATABASE)
    return path


def test_errors_are_names_of_the_package() -> None:
    for name in ("AeroError", "InputError", "UnknownNameError", "StoreError", "GateRefusal"):
        assert name in aerodb.__all__
    with pytest.raises(aerodb.AeroError):
        aerodb.load_database("none.toml")


def test_a_workspace_and_a_client_have_one_vocabulary(
    shared: SharedWorkspaces, tmp_path: Path
) -> None:
    workspace, _ = shared.updated(tmp_path / "w")
    opened = aerodb.open_workspace(workspace.root)
    flight = asked(workspace.root, "flight", "list")[0]["flight"]
    with served(workspace) as address, aerodb.Client(address, TOKEN) as client:
        assert client.flight(flight) == _json(opened.flight(flight))
        assert list(client.findings()) == _json(list(opened.findings()))
        assert client.finding("candidate", NAME) == _json(opened.finding("candidate", NAME))
        told = str(client.finding("candidate", NAME)).splitlines()
        assert told == str(opened.finding("candidate", NAME)).splitlines()
        assert re.search(r"proved +on 2 flights not used: error of CZ", "\n".join(told[:5]))
        lines = str(client.flight(flight)).splitlines()
        assert lines == str(opened.flight(flight)).splitlines()
        assert re.fullmatch(rf"flight \S+ of {NAME}: \w+", lines[0])
        assert any("v0002" in line for line in lines[:MOST_LINES])
        assert max(len(told), len(lines)) <= 10
        assert client.flight(flight)._repr_html_().startswith(f"<strong>{lines[0]}")
        for name, series in client.channels(flight, ["alpha", "CZ"], end=6.0, points=50).items():
            own = opened.channels(flight, ["alpha", "CZ"], end=6.0, points=50)[name]
            pd.testing.assert_series_equal(series, own)
            assert series.attrs == own.attrs
        assert client.export("candidate", "csv") == opened.export("candidate", "csv")
        with pytest.raises(aerodb.InputError, match="gif"):
            opened.export("candidate", "gif")
        ours = opened.evaluate("candidate", alpha="5 deg", V=25.0)
        theirs = client.evaluate("candidate", alpha="5 deg", V=25.0)["coefficients"]
        assert theirs["CZ"] == pytest.approx(float(ours["CZ"][0]), rel=1e-12)
        assert client.evaluate("candidate", alpha=2.0, V=25.0)["at"]["alpha"] == 2.0


def test_a_version_is_printed_with_what_was_found_and_proved(
    shared: SharedWorkspaces, tmp_path: Path
) -> None:
    workspace, _ = shared.updated(tmp_path / "w")
    opened = aerodb.open_workspace(workspace.root)
    lines = str(opened.version("candidate")).splitlines()
    shown = on_terminal(workspace.root, 500, "version", "show", "candidate")[1]
    for line in lines[1:]:
        told = line.replace('finding("v0002")', "below").split()
        assert told in [each.split() for each in shown]
    assert any(line.startswith("  proved") for line in lines)
    assert len(lines) <= 5
    assert "proved" in opened.version("candidate")._repr_html_()
    assert str(opened.version("v0001")) == f"version v0001 of {NAME} (released)"


def _json(found: Any) -> Any:
    import json

    from aerodb.tasks.view import as_json

    return json.loads(as_json(found))


def test_a_database_may_be_its_file_and_flights_are_a_list(
    compared: list[Any], shared: SharedWorkspaces
) -> None:
    file = shared.logs[0].parent / "database.toml"
    again = aerodb.compare(compared[0].measured, file)
    pd.testing.assert_frame_equal(again.to_pandas(), compared[0].to_pandas())
    for ask in (
        aerodb.trace,
        lambda one: aerodb.update(one, MODEL),
        lambda one: aerodb.fit(one, MODEL),
        lambda one: aerodb.validate(one, compared[0].database),
    ):
        with pytest.raises(aerodb.InputError, match=r"write \[flight\]"):
            ask(compared[0])


def test_print_of_points_shows_their_values(results: list[Any]) -> None:
    points = results[8]
    lines = str(points).splitlines()
    assert lines[0].endswith(" at 2 points")
    low, high = sorted(points["CZ"])
    assert f"  CZ  {low:.6g} to {high:.6g}, " in str(points)
    one = aerodb.evaluate(points.database, alpha=0.1, V=25.0)
    assert " at 1 point\n" in str(one)
    assert f"  CZ  {one['CZ'][0]:.6g}, " in str(one)
