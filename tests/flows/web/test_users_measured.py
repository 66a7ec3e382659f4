"""The tasks of the eight kinds of users on measured flights, whose database lacks a derivative: lines
until the answer, clicks until the decision. Nothing here is simulated, and nothing can be released."""

import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from aerodb.storage.workspace import Workspace
from tests.support.browser import Clicks, counted, look_everywhere, visit, watched
from tests.support.command import asked
from tests.support.console_workspace import served
from tests.support.guide_flights import prepare
from tests.support.paths import ROOT
from tests.support.terminal import answered

STUDY = ROOT / "docs" / "studies" / "attas-dihedral.md"
#: Records of manoeuvres that differ.
RECORDS = ("fAttasElv1.mat", "fAttasAil1.mat", "fAttasRud1.mat")
#: Logs that nobody has described: of six sources, in four formats.
UNKNOWN = (
    "px4_ulog/sample.ulg",
    "twin_otter/totter_f1_017_data.mat",
    "hfb320/hfb320_1_10.asc",
    "citation/flight_2019-03-12.parquet",
    "ampyx_ap2/validationDataFC114_1_v2_pc.mat",
    "ddd/fixedwing_model.csv",
)
#: The first plot of a log's page can be seen.
DRAWN = "() => document.querySelector('.plot img')?.naturalWidth > 0"


@pytest.fixture(scope="module")
def attas(measured: Callable[[str], Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A workspace with the measured records, the database without its dihedral, and what a loop
    made of them when it was asked to add it."""
    logs = [str(measured(f"attas/{name}")) for name in RECORDS]
    folder = tmp_path_factory.mktemp("attas")
    prepare(STUDY.read_text("utf-8"), folder)
    database = folder / "cut.toml"
    whole = (folder / "uncut.toml").read_text("utf-8")
    database.write_text(whole.replace("beta = -0.0512", "beta = 0.0"), encoding="utf-8")
    workspace = folder / "w"
    asked(workspace, "vehicle", "add", str(folder / "attas.toml"))
    asked(workspace, "database", "import", str(database), "--vehicle", "attas")
    ingest = ("flight", "ingest", *logs, "--vehicle", "attas", "--direct")
    answered(workspace, ingest, "3 of 3 logs stored", "next +aerodb")
    return workspace


@pytest.fixture(scope="module")
def traced(attas: Path) -> Path:
    """The scientist's task comes first: the others look at what it made."""
    loop = ("close-loop", "--vehicle", "attas", "--direct")
    accept = ("--accept-suspected", "beta_slope@Cl")
    answered(
        attas,
        (*loop, *accept),
        r"found +slope of Cl with sideslip 0 -> -0\.05\d+ \+- \S+ 1/rad \(suspected\)",
        r"proved +on parts not used: error of Cl \S+ -> \S+ \(\d+ -> \d+ %\)",
        "gate +refuses",
        "next +aerodb version gate v0002",
    )
    return attas


@pytest.fixture(scope="module")
def address(traced: Path) -> Iterator[str]:
    with served(Workspace.open(traced)) as opened:
        yield opened


@pytest.mark.parametrize("record", UNKNOWN)
def test_a_hobbyist_sees_what_an_unknown_log_holds(
    browser: Any, measured: Callable[[str], Path], record: str, tmp_path: Path
) -> None:
    log, page_file = str(measured(record)), tmp_path / "log.html"
    answered(tmp_path / "none", ("log", "inspect", log), "USABLE|cannot", "next +aerodb")
    began = time.perf_counter()
    answered(tmp_path / "none", ("log", "show", log, "--output", str(page_file)), "plots")
    with watched(browser, "file://") as page:
        page.goto(page_file.as_uri())
        page.wait_for_function(DRAWN)
        print(f"first plot of {record} after {time.perf_counter() - began:.1f} s")


def test_a_flight_test_engineer_knows_whether_the_flight_was_good(traced: Path) -> None:
    show = ("flight", "show", "fAttasAil1.mat")
    answered(traced, show, "is limited: it is used", "because +phi remains", "next +aerodb")
    beside = ("flight", "compare", "fAttasRud1.mat", "released")
    answered(traced, beside, "axes err beyond noise", r"most +C\w errs by \d", "next +aerodb")
    answered(traced, ("flight", "show", "fAttasElv1.mat"), "is good", "next +aerodb")


def test_a_simulator_engineer_gets_the_file(traced: Path, tmp_path: Path) -> None:
    target = tmp_path / "attas.xml"
    export = ("version", "export", "v0002", "--format", "jsbsim", "--output", str(target))
    answered(traced, export, "read back, 20 check cases pass")
    assert b"<aerodynamics" in target.read_bytes()


def test_an_operator_and_a_manager_know_what_waits_and_whether_it_is_better(
    browser: Any, traced: Path, address: str
) -> None:
    answered(traced, ("status",), "1 thing to do", "v0002 of attas waits for a decision")
    answered(traced, ("version", "show", "v0002"), r"proved .* error of Cl \S+ -> ", "next +aerodb")
    answered(traced, ("version", "lineage", "v0002"), "based on 3 flights", "next +aerodb")
    with watched(browser, address) as page:
        visit(page, address, "/")
        assert "v0002 of attas waits for your decision" in page.locator("main").inner_text()
        listed = page.locator("td.wide").first.inner_text()
        assert "unconfirmed changes" in listed
        assert "error of Cl" in listed
        look_everywhere(page, "measured")


def test_a_chief_engineer_sees_why_it_must_not_be_released(
    browser: Any, traced: Path, address: str
) -> None:
    gate = ("version", "gate", "v0002")
    answered(
        traced, gate, "v0002 would be refused", r"gate +\d+ of 12 checks pass; fails \w", code=1
    )
    with watched(browser, address) as page:
        visit(page, address, "/")
        clicks = Clicks(page)
        clicks.on("text=Decide on v0002")
        assert "The gate would refuse it." in page.locator("main").inner_text()
        look_everywhere(page, "refused")
        counted(clicks)


def test_a_qualification_engineer_sees_what_is_missing(traced: Path) -> None:
    validate = ("version", "validate", "v0002")
    answered(
        traced, validate, r"checks within tolerance: \d+ of \d+", r"not covered +2\.c", "next +aerodb",
        code=4,
    )  # fmt: skip
