"""Report pages: result first, numbers as in the JSON, nothing fetched, log names as text; PDF."""

import base64
import json
import re
import sys
import threading
from collections.abc import Iterable, Iterator
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path
from typing import Any

import pytest
from lxml import etree, html
from typer.testing import CliRunner

from aerodb.errors import InputError, UnknownNameError
from aerodb.flows.cli.main import app
from aerodb.flows.flight import flight_flow
from aerodb.flows.report import report_flow
from aerodb.flows.run import run_flow
from aerodb.increments.validation import AxisValidation, HoldOut
from aerodb.remarks import SAID, Remark
from aerodb.report.decision import decision
from aerodb.report.error_table import error_rows
from aerodb.report.loop_documents import loop_document
from aerodb.report.numbers import number
from aerodb.report.page import pdf
from aerodb.report.update_page import UpdateStory, update_report
from aerodb.storage.workspace import Workspace
from aerodb.tasks.actors import user
from aerodb.tasks.provenance import code_version
from aerodb.tasks.steps.compare import compare_with_version
from aerodb.tasks.workspace_access import access_workspace
from aerodb.tracing.decision.findings import Finding, NotFound, Traced, Vote
from aerodb.tracing.decision.unexplained_residual import UnexplainedResidual
from tests.support.command import asked
from tests.support.paths import ROOT, VEHICLES
from tests.support.small_glider import NAME, write_files

#: Names that logs may have on disk: markup, a formula, a direction override, an escape sequence.
HOSTILE = (
    "<img src=x onerror=alert(1)>.csv",
    r"$\frac{1}{$.csv",
    "‮evil‬.csv",
    "\x1b[2Jclear.csv",
    '"><script>alert(2)<.csv',
    f"{'long' * 50}.csv",
)


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any]]:
    """A workspace of six flights from logs with hostile names, and the answer of an update."""
    folder, workspace = tmp_path_factory.mktemp("files"), tmp_path_factory.mktemp("made") / "w"
    logs = [
        log.rename(log.parent / name)
        for log, name in zip(write_files(folder), HOSTILE, strict=True)
    ]
    asked(workspace, "vehicle", "add", str(folder / "vehicle.toml"))
    asked(workspace, "database", "import", str(folder / "database.toml"), "--vehicle", NAME)
    outcomes = asked(workspace, "flight", "ingest", *map(str, logs), "--vehicle", NAME, "--direct")
    assert [outcome["status"] for outcome in outcomes] == ["stored"] * 6
    return workspace, asked(
        workspace, "update", "--vehicle", NAME, "--model", str(folder / "model.toml"), "--direct"
    )


def written(workspace: Path, *arguments: str) -> str:
    """The page that a report command writes."""
    output = workspace.parent / "page.html"
    answer = asked(workspace, "report", *arguments, "--output", str(output))
    assert answer["size"] == output.stat().st_size
    return output.read_text(encoding="utf-8")


def checked(pieces: Iterable[str]) -> Any:
    """The page as a tree, after what holds for every page: nothing runs, nothing is fetched, every
    picture has a text."""
    page = "".join(pieces)
    tree = html.document_fromstring(page)
    assert not tree.xpath("//script | //link | //iframe | //object | //base | //form")
    assert not [name for element in tree.iter() for name in element.attrib if name.startswith("on")]
    sources = [element.get("src") for element in tree.xpath("//*[@src]")]
    assert all(source.startswith("data:image/svg+xml;base64,") for source in sources)
    assert not tree.xpath("//@href | //@srcset")
    assert not re.search(r"url\s*\(|@import", page), "the style asks for nothing"
    assert "default-src 'none'" in page
    for source in sources:
        shown = etree.fromstring(base64.b64decode(source.partition(",")[2]))
        assert not list(shown.iter("{*}script"))
        assert not [
            href
            for href in shown.xpath("//@*[local-name()='href']")
            if not href.startswith(("#", "data:image/png"))
        ]
    assert all(image.get("alt") for image in tree.xpath("//img"))
    assert tree.get("lang") == "en"
    assert len(tree.xpath("//h1")) == 1
    assert "\u202e" not in page
    assert "\x1b" not in page
    return tree


def words_of(tree: Any) -> str:
    return " ".join(tree.xpath("//main")[0].text_content().split())


def table(tree: Any, heading: str) -> list[list[str]]:
    """The rows of the first table below the heading that begins with `heading`."""
    (found,) = tree.xpath(
        f"(//h2[starts-with(normalize-space(), '{heading}')]/following::table)[1]"
    )
    return [
        [" ".join(cell.text_content().split()) for cell in row]
        for row in found.xpath(".//tbody/tr")
    ]


def test_the_page_of_a_flight(made: tuple[Path, dict[str, Any]]) -> None:
    workspace, update = made
    flight = update["flights"]["identified"][0]
    tree = checked(written(workspace, "flight", flight[:12]))
    shown = asked(workspace, "flight", "show", flight[:12])
    lead = tree.xpath("//p[@class='lead']")[0].text_content()
    assert lead.strip().startswith(shown["verdict"]), "the verdict first"
    assert "v0002 (identified)" in words_of(tree)
    facts = {dt.text: dt.getnext().text_content() for dt in tree.xpath("//dl[1]/dt")}
    assert (facts["Author"], facts["Workspace"]) == (user(), str(workspace))
    assert facts["Program"] == f"aerodb {code_version()}"
    baseline = compare_with_version(
        flight, workspace=str(workspace), run="", version=update["baseline"]
    )
    compared = {
        "axes": {axis: entry for axis, entry in baseline["axes"].items() if entry["samples"]}
    }
    rows = {row[0]: row for row in table(tree, "Coefficients compared with v0001")}
    assert {axis: row[2:4] for axis, row in rows.items()} == {
        axis: [number(entry["rms_measured"], zeros=True), number(entry["rms_residual"], zeros=True)]
        for axis, entry in compared["axes"].items()
    }
    assert [row[0] for row in table(tree, "Flight envelope")][:2] == [
        "V [m/s]",
        "alpha [deg]",
    ]
    reach = {row[0]: row[4] for row in table(tree, "Flight envelope")}
    assert reach["alpha [deg]"] == "−4 to 12", "the breakpoints of the handbook, in degrees"


@pytest.mark.parametrize(
    "name",
    [HOSTILE[0], *(pytest.param(name, marks=pytest.mark.campaign) for name in HOSTILE[1:])],
    ids=range(len(HOSTILE)),
)
def test_names_of_logs_are_text_on_the_page_of_a_flight(
    made: tuple[Path, dict[str, Any]], name: str
) -> None:
    workspace, _ = made
    access = access_workspace(str(workspace))
    (flight,) = [
        f.id
        for f in access.catalogue.flights()
        if access.catalogue.log(f.log_sha256).name.endswith(name)
    ]
    tree = checked(written(workspace, "flight", flight))
    shown = name.replace("\x1b", "\\x1b").replace("\u202e", "\\u202e").replace("\u202c", "\\u202c")
    assert tree.xpath("//h1/bdi")[0].text.endswith(shown)


def test_the_page_of_an_update(made: tuple[Path, dict[str, Any]]) -> None:
    workspace, update = made
    tree = checked(written(workspace, "update", "candidate"))
    lead = tree.xpath("//p[@class='lead']")[0].text_content()
    shown = decision({**update, "label": "v0002"})
    assert lead == shown.verdict, "the result is said once"
    lines = tree.xpath("//dl[contains(@class, 'decision')]/dt")
    assert [line.text_content() for line in lines] == [label for label, _ in shown.lines]
    facts = {
        term.text_content(): term.getnext().text_content()
        for term in tree.xpath("(//dl[@class='facts'])[1]/dt")
    }
    made_by = access_workspace(str(workspace)).catalogue.version_of_id(update["candidate"])
    assert facts["Date"] == f"{made_by.created_utc:%Y-%m-%d %H:%M} UTC"
    assert (facts["Author"], facts["Workspace"]) == (user(), str(workspace))
    assert facts["Program"] == f"aerodb {code_version()}"
    proved = words_of(tree)
    assert re.search(r"on 2 flights not used: error of C[XZ] [\d.]+ → [\d.]+ \(", proved)
    assert "+-" not in proved
    assert "->" not in proved
    rows = {row[0]: row for row in table(tree, "Error before and after") if len(row) > 1}
    assert set(rows) == set(update["axes"])
    for axis, entry in update["axes"].items():
        assert rows[axis][1:3] == [
            number(entry[f"held_out_rms_{side}"], zeros=True) for side in ("before", "after")
        ]
        times = entry["held_out_rms_after"] / entry["noise_floor"] if entry["noise_floor"] else None
        assert rows[axis][4] == number(times, 2, zeros=True)
        assert rows[axis][-1] == entry["outcome"]
    axis = update["increments"][0]
    assert [row[:6] for row in table(tree, "Estimated increments")] == [
        [
            "constant" if term["term"] == "1" else term["term"],
            number(term["value"], 4),
            number(term["standard_error"], 2),
            *(number(end) for end in term["ci95"]),
            {"alpha": "1/rad", "delta_elevator": "1/rad"}.get(term["term"], "-"),
        ]
        for term in axis["terms"]
    ]
    matrix = tree.xpath(f"//table[contains(caption, '{axis['axis']}: correlations')]//tbody/tr")
    assert [cell.text_content() for cell in matrix[-1][1:]] == [
        f"{value:.2f}".replace("-", "−") for value in axis["correlation"][-1]
    ]
    file = Path(update["page"])
    assert (file.parent, file.suffix) == (
        workspace / "reports",
        ".html",
    ), "the update itself has written its report"
    assert file.read_text(encoding="utf-8") == written(workspace, "update", "candidate"), (
        "the same page, whoever makes it"
    )
    roles = [row[2] for row in table(tree, "Flights")]
    assert sorted(roles) == ["held out"] * 2 + ["identified"] * 4
    shown = [bdi.text_content() for bdi in tree.xpath("//h2[.='Flights']/following::table[1]//bdi")]
    escaped = [
        name.replace("\x1b", "\\x1b").replace("\u202e", "\\u202e").replace("\u202c", "\\u202c")
        for name in HOSTILE
    ]
    assert sorted(text.rpartition("/")[2] for text in shown) == sorted(escaped)


def test_the_page_of_a_version(made: tuple[Path, dict[str, Any]]) -> None:
    workspace, update = made
    tree = checked(written(workspace, "version", "candidate"))
    words = words_of(tree)
    assert update["candidate"] in words
    boxes = [text.text_content() for text in tree.xpath("//svg//text")]
    assert boxes[0] == "v0001"
    assert "4 identified, 2 held out" in boxes
    lead = tree.xpath("//p[@class='lead']")[0].text_content()
    assert lead.startswith("v0002, recommendation: ")
    labels = [term.text_content() for term in tree.xpath("(//dl)[1]/dt")]
    assert labels[0] == "changes"
    assert {"proved", "gate", "open"} <= set(labels)
    ends = next(words for words in words_of(tree).split(": ") if "flown range" in words)
    assert re.search(r"the change fades to nothing at −?[\d.]+ and [\d.]+ deg", ends)
    edits = table(tree, "Changes from v0001")
    changed = {(row[0], row[1].removeprefix("slope with ")) for row in edits}
    assert changed == {
        (entry["axis"], "constant" if term["term"] == "1" else term["term"])
        for entry in update["increments"]
        for term in entry["terms"]
    }
    imported = checked(written(workspace, "version", "v0001"))
    first = imported.xpath("//p[@class='lead']")[0].text_content()
    assert first.startswith("An imported database, released since ")
    assert "handbook: " in words_of(imported)
    assert not imported.xpath("//h2[starts-with(., 'Changes from')]"), (
        "nothing differs from what is not there"
    )
    assert len(imported.xpath("//img")) == 1, "its curves"
    assert written(workspace, "version", "v0002") == written(workspace, "version", "candidate"), (
        "the same page twice"
    )


def test_what_is_refused(made: tuple[Path, dict[str, Any]], tmp_path: Path) -> None:
    workspace, _ = made
    output = ("--output", str(tmp_path / "x.html"))
    inside = ("--output", str(workspace / "catalogue.sqlite"))
    for root, arguments, kind, said in (
        (
            workspace,
            ("update", "v0001", *output),
            InputError,
            "was imported, not made by an update",
        ),
        (workspace, ("update", "0" * 64, *output), UnknownNameError, "unknown version"),
        (workspace, ("flight", "none", *output), UnknownNameError, "unknown flight 'none'"),
        (
            workspace,
            ("version", "candidate", *inside),
            InputError,
            "cannot be written into the workspace",
        ),
        (tmp_path / "none", ("version", "released", *output), InputError, "no workspace here"),
    ):
        refused = CliRunner().invoke(app, ["--workspace", str(root), "report", *arguments])
        assert isinstance(refused.exception, kind), refused.exception
        assert said in str(refused.exception)
    assert not (tmp_path / "x.html").exists()
    assert not (tmp_path / "none").exists()


def proof(axis: str, before: float, after: float, **other: Any) -> AxisValidation:
    known = {
        "rms_before": before,
        "rms_after": after,
        "held_out_rms_before": before,
        "held_out_rms_after": after,
    }
    known |= {
        "held_out_shape_before": before,
        "held_out_shape_after": after,
        "excess_before": None,
        "excess_after": None,
    }
    known |= {
        "noise_floor": 0.001,
        "repeatability": 0.0,
        "theil": None,
        "explained": 0.9,
        "outcome": "improved",
    }
    return AxisValidation(axis=axis, **{**known, **other})


def found(
    hypothesis: str = "pitch_rate_force@CX", verdict: Any = "confirmed", **other: Any
) -> Finding:
    effect, _, axis = hypothesis.partition("@")
    votes = tuple(Vote(f"f{k}", -0.2 + 0.01 * k, 0.02) for k in range(4))
    known: dict[str, Any] = {
        "subject": "",
        "parameter": f"{axis}_q",
        "unit": "1",
        "value": -0.19,
        "ci95": (-0.22, -0.16),
    }
    known |= {
        "p_adjusted": 1e-4,
        "votes": votes,
        "explanation_set": (hypothesis, "alpha_dot@CX"),
        "refound": (4, 4),
    }
    known |= {
        "what": "force along x from pitch rate",
        "size": "CX_q = -0.19",
        "reasons": (),
        "fallen": {"<b>mach_effect</b>": Remark(SAID, text="explains less & less")},
    }
    return Finding(
        hypothesis=hypothesis, effect=effect, axis=(axis,), verdict=verdict, **{**known, **other}
    )


def loop(
    findings: list[Finding],
    added: list[Finding],
    proofs: list[AxisValidation],
    left: tuple[UnexplainedResidual, ...] = (),
) -> dict[str, Any]:
    not_found = (
        NotFound(
            "alpha_bias@all",
            "alpha_bias",
            ("CZ",),
            "",
            "not_detected",
            "alpha_bias",
            "rad",
            0.01,
            0.02,
        ),
        NotFound("flap@CZ", "flap", ("CZ",), "flap", "not_excited", "CZ_flap", "1/rad", None, None),
    )
    traced = Traced(("f0", "f1"), tuple(findings), not_found, ("move the flap on its own",), ())
    document = loop_document(
        vehicle="v",
        baseline="b" * 64,
        hold_out=HoldOut(("f0", "f1", "f2", "f3"), ("f4", "f5"), "held-out"),
        excluded=[("f6", "rejected: <i>qbar</i>")],
        looks={"f4": 1},
        library="c" * 64,
        rounds=1,
        traced=traced,
        findings=findings,
        added=added,
        left=left,
        proof=proofs,
        remarks=[],
    )
    return json.loads(json.dumps(document))


def page_of(document: dict[str, Any]) -> Any:
    labels = {f"f{k}": f"flight <{k}>" for k in range(7)}
    return checked(update_report(UpdateStory(document, labels, "v0001", None, None, {}, {}, {})))


def test_an_error_that_nothing_names_is_said() -> None:
    """Far above the noise, and no finding on the axis: said once, and not where something is."""
    far = proof("CX", 0.2, 0.2, outcome="unchanged", held_out_shape_after=0.1)
    near = proof("CZ", 0.2, 0.2, outcome="unchanged", held_out_shape_after=0.002)
    said = [r for r in loop([], [], [far, near])["remarks"] if "noise floor" in r]
    assert len(said) == 1
    assert said[0].startswith("CX stays at 100 times its noise floor")
    remarks = loop([found(verdict="suspected")], [], [far])["remarks"]
    assert not any("noise floor" in remark for remark in remarks)


def test_the_page_says_what_differs_between_flights() -> None:
    document = loop([], [], [proof("CX", 0.002, 0.002, outcome="unchanged")])
    assert document["between_flights"] == []
    assert not page_of(document).xpath("//h2[text()='Differs between flights']")
    entry = {"because": "Cl_da falls by 5 % <per> kPa", "settled_by": "one flight"}
    tree = page_of({**document, "between_flights": [entry]})
    (said,) = tree.xpath("//h2[text()='Differs between flights']/following-sibling::ul[1]/li")
    assert said.text_content() == "Cl_da falls by 5 % <per> kPa."


def test_the_page_of_a_loop_that_finds_nothing() -> None:
    """The empty case: said in the first sentence, with the size that is excluded; nothing is drawn
    as if it were found."""
    document = loop([], [], [proof("CX", 0.002, 0.002, outcome="unchanged")])
    tree = page_of(document)
    lead = tree.xpath("//p[@class='lead']")[0].text_content()
    assert lead == decision({**document, "label": None}).verdict
    assert len(tree.xpath("//img")) == 1
    assert table(tree, "What these flights cannot decide") == [
        ["effectiveness of the flap on CZ", "not excited", "none", "–", "1/rad"]
    ]
    excluded = tree.xpath("//details[contains(., 'Tested and not found (1)')]//tbody/tr")[0]
    assert [cell.text_content() for cell in excluded] == [
        "constant error of angle of attack",
        "0.573",
        "1.15",
        "deg",
    ]
    assert "Move the flap on its own" in tree.xpath("//ul[@class='next']")[0].text_content()


def test_the_page_of_a_finding_says_why_that_and_not_its_rivals() -> None:
    document = loop([found(verdict="alias_group")], [], [proof("CX", 0.02, 0.02)])
    tree = page_of(document)
    assert "1. Slope of CX with pitch rate alias group not added" in words_of(tree)
    assert (
        tree.xpath("//dt[.='Explains it as well']/following-sibling::dd[1]")[0].text_content()
        == "slope of CX with rate of angle of attack"
    )
    assert ["<b>mach_effect</b>", "explains less & less"] in [
        [cell.text_content() for cell in row]
        for row in tree.xpath("//details[contains(., 'Rejected alternatives')]//tbody/tr")
    ]
    assert len(tree.xpath("//img")) == 2, "errors and one forest plot"
    assert ["flight <6>", "f6", "excluded", "rejected: <i>qbar</i>"] in table(tree, "Flights")
    assert ["flight <4>", "f4", "held out", "used to validate 1 earlier version"] in table(
        tree, "Flights"
    )


def test_what_no_template_explains_is_told_with_its_variables() -> None:
    rest = UnexplainedResidual(
        "CX",
        True,
        0.3,
        0.01,
        ("alpha",),
        (0.3, 0.3),
        "30 % of CX follows <script>alpha</script> & no template fits",
    )
    tree = page_of(loop([], [], [proof("CX", 0.02, 0.02)], (rest,)))
    words = words_of(tree)
    assert (
        "Error of CX that no known effect fits unnamed not added 30 % of CX follows <script>alpha</script> & no template"
        " fits." in words
    )
    assert len(tree.xpath("//img")) == 1, "there is no parameter, and no vote to draw"


def test_errors_are_told_in_the_usual_order_of_axes() -> None:
    assert [
        row["axis"] for row in error_rows(loop([], [], [proof("C_lift", 1, 1), proof("Cn", 1, 1)]))
    ] == ["Cn", "C_lift"]


def test_a_page_becomes_a_pdf_and_fetches_nothing(
    made: tuple[Path, dict[str, Any]], tmp_path: Path
) -> None:
    try:
        pdf("<p>text")
    except InputError as missing:
        pytest.skip(str(missing))
    asked_for: list[str] = []

    class Server(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            asked_for.append(self.path)
            self.send_error(404)

        def log_message(self, *_: Any) -> None:
            pass

    with HTTPServer(("127.0.0.1", 0), Server) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        address = f"http://127.0.0.1:{server.server_port}"
        page = (
            f'<img src="{address}/a.png"><style>@import url({address}/b.css)</style><img'
            ' src="file:///etc/hostname">text'
        )
        assert pdf(page).startswith(b"%PDF")
        server.shutdown()
    assert asked_for == []
    output = tmp_path / "version.pdf"
    asked(made[0], "report", "version", "candidate", "--pdf", "--output", str(output))
    assert output.read_bytes().startswith(b"%PDF")


def test_on_paper_a_version_is_short_and_no_page_is_empty(
    made: tuple[Path, dict[str, Any]],
) -> None:
    """The recommendation is on the first page; every page has text of its own, and its footer."""
    weasyprint = pytest.importorskip("weasyprint", exc_type=ImportError)
    most = {("version", "candidate"): 3, ("version", "v0001"): 2, ("update", "candidate"): 4}
    for (kind, about), count in most.items():
        page = written(made[0], kind, about)
        printed = weasyprint.HTML(string=page).render().pages
        assert len(printed) <= count, (kind, len(printed))
        words = [" ".join(_words(sheet._page_box)) for sheet in printed]
        assert all(len(text) > 200 for text in words), (kind, [len(text) for text in words])
        assert "SI units unless stated" in words[0]
        if about == "candidate" and kind == "version":
            assert "recommendation: " in words[0]
            assert "the change fades to nothing at" in words[0]


def test_no_expression_of_a_template_writes_a_quoted_attribute() -> None:
    """Its quotes would be escaped, and the attribute be another: what is for the screen only was
    printed so."""
    for folder in ("aerodb/report", "flows/web"):
        for path in sorted((ROOT / folder / "templates").glob("*.html")):
            found = re.findall(r"""\{\{[^}]*['"] ?[\w-]+=['"]""", path.read_text("utf-8"))
            assert not found, (path.name, found)


def _words(box: Any) -> Iterator[str]:
    """Text of a laid-out page."""
    if hasattr(box, "text"):
        yield box.text
    for child in getattr(box, "children", ()):
        yield from _words(child)


def test_without_the_extra_pdf_is_refused_with_the_remedy(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "weasyprint", None)
    with pytest.raises(InputError, match="PDF needs WeasyPrint") as refused:
        pdf("<p>text")
    assert "aerodb[pdf]" in refused.value.remedy


def test_the_page_of_a_measured_flight(measured: Any, tmp_path: Path) -> None:
    """A Twin Otter record, without a database: verdict, consistency and histories all the same."""
    log = measured("twin_otter/totter_9752ed20_data.mat")
    workspace = Workspace.open(tmp_path / "w")
    text = (VEHICLES / "twin_otter.toml").read_text(encoding="utf-8")
    access_workspace(str(workspace.root)).catalogue.add_vehicle("twin-otter", text)
    (outcome,) = run_flow(
        flight_flow, {"logs": [str(log)], "vehicle": "twin-otter"}, workspace, "direct"
    )
    page = run_flow(
        report_flow,
        {"kind": "flight", "about": outcome["flight"], "version": ""},
        workspace,
        "direct",
    )
    tree = checked(page)
    channels = {entry["channel"]: entry for entry in outcome["consistency"]["channels"]}
    rows = {row[0]: row for row in table(tree, "Kinematic consistency")}
    assert set(rows) == set(channels)
    assert rows["beta"][1] == number(channels["beta"]["before"] * 57.29577951308232)
    assert rows["V"][5] == channels["V"]["verdict"]
    assert "no released database yet" in words_of(tree)


def test_a_closed_loop_writes_its_report_whatever_it_finds(
    made: tuple[Path, dict[str, Any]],
) -> None:
    answer = asked(made[0], "close-loop", "--vehicle", NAME, "--baseline", "v0001", "--direct")
    page = Path(answer["page"]).read_text(encoding="utf-8")
    lead = checked(page).xpath("//p[@class='lead']")[0].text_content()
    assert lead == decision(answer).verdict
    assert page == written(made[0], "update", answer["report"]), "from what is stored, by its key"
