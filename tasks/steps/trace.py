"""Tracing: the frozen library of a campaign, one stored Gram per flight, and the findings of all of them."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from aerodb.coefficients import Comparison
from aerodb.effects import (
    Hypothesis,
    columns_of,
    hypotheses_for,
    library_sha256,
    of_flow_angles,
    parse_effects,
    registered_templates,
    view_of,
    within_what_is_known,
)
from aerodb.errors import InputError
from aerodb.exchange import database_document_sha256
from aerodb.flight import Flight
from aerodb.storage.files import read_gram, write_gram
from aerodb.support import result_key
from aerodb.tables import AeroDatabase, Law, Relay
from aerodb.tasks.provenance import code_version
from aerodb.tasks.result_versions import RESULT_VERSION
from aerodb.tasks.stall import cross_fitted_laws, of_family, stalled_flights, with_laws
from aerodb.tasks.stall_loops import cross_fitted_loops, loop_of_family, with_loops
from aerodb.tasks.steps.coefficients import load_coefficients
from aerodb.tasks.steps.compare import beside
from aerodb.tasks.steps.consistency import applied_errors, load_consistent, noise_of, reconstructed_angles
from aerodb.tasks.steps.update import Plan
from aerodb.tasks.workspace_access import Stores, stores
from aerodb.tracing import (
    LONG,
    Evidence,
    Finding,
    Gram,
    Settings,
    Traced,
    as_commanded,
    bounded_noise,
    evidence_of,
    gram,
    noisy_copies,
    thinned,
    tracing_bandwidth,
    with_instruments,
    with_shapes,
)


@dataclass(frozen=True)
class Library:
    """What may be found, fixed before a residual is looked at: hypotheses, settings of tracing, and the hash of both.

    stall : flight -> the law of its stall that the *other* flights agree with; its family is part of the hash, its numbers are
    not. Empty where fewer than two flights stall. loops : likewise, angles of the closed loop that is its rival. reconstructed :
    flow angles that no flight has a sensor of: no sensor of theirs is a hypothesis.
    """

    hypotheses: tuple[Hypothesis, ...]
    settings: Settings
    sha256: str
    stall: Mapping[str, Law] = field(default_factory=dict)
    loops: Mapping[str, Relay] = field(default_factory=dict)
    reconstructed: frozenset[str] = frozenset()

    @property
    def remarks(self) -> tuple[str, ...]:
        """What a reader must know of what is not in it."""
        if not self.reconstructed:
            return ()
        angles = " and ".join({"alpha": "angle of attack", "beta": "sideslip"}[name] for name in sorted(self.reconstructed))
        what = f"No flight has a sensor of {angles}: errors of such a sensor are no hypotheses, those of the reconstruction are"
        return (f"{what}. What stays open between them and the model, a flight with a vane or a five-hole probe decides.",)


def freeze_library(plan: Plan, *, workspace: str, run: str, effects: str = "", expected: str = "") -> Library:
    """The library for the plan's baseline, vehicle and flights' channels; `effects` is the text of a file of user templates.

    Only channels' names and flight conditions are looked at. Raises InputError when its hash is not the `expected` one.
    """
    opened = stores(workspace)
    vehicle, _ = opened.vehicle(plan.vehicle)
    database = opened.database(plan.baseline)
    flights = [load_coefficients(opened, opened.catalogue.flight(id), run)[0] for id in plan.hold_out.identified]
    channels = set[str]().union(*(flight.channels for flight in flights))
    user = (*registered_templates(), *(parse_effects(effects) if effects else ()))
    documents = [load_consistent(opened, opened.catalogue.flight(id), run)[1] for id in plan.hold_out.identified]
    made = [reconstructed_angles(document) for document in documents]
    reconstructed = frozenset({"alpha", "beta"}).intersection(*made)
    hypotheses = hypotheses_for(database, vehicle, channels, user=user)
    hypotheses = of_flow_angles(hypotheses, {"alpha", "beta"} - reconstructed, frozenset[str]().union(*made))
    stalled = stalled_flights(opened, plan.hold_out.identified, run)
    if stalled:
        hypotheses = (*of_family(hypotheses), loop_of_family(database, vehicle))
    settings = Settings(bandwidth=tracing_bandwidth(database, vehicle, flights))
    sha256 = library_sha256(hypotheses, settings=None)
    if expected and not sha256.startswith(expected):
        what = f"the library is {sha256[:12]}, not {expected[:12]}: it changed after it was frozen"
        remedy = "trace with the library that was frozen, or leave --library out and say why it changed"
        raise InputError(what, "close-loop", remedy)
    laws: dict[str, Law] = {}
    loops: dict[str, Relay] = {}
    if stalled:
        laws, loops = cross_fitted_laws(opened, stalled, database, run), cross_fitted_loops(opened, stalled, database, run)
        hypotheses = with_loops(with_laws(hypotheses, laws, database, vehicle), loops, database, vehicle)
    if "alpha" in reconstructed:
        hypotheses = within_what_is_known(hypotheses, [applied_errors(document) for document in documents])
    return Library(hypotheses, settings, sha256, laws, loops, reconstructed)


def trace_flight(flight: str, *, workspace: str, run: str, library: Library, database: AeroDatabase) -> Gram:
    """The Gram of a flight (its id) beside a database; read back when it is stored, else made and stored."""
    opened = stores(workspace)
    row = opened.catalogue.flight(flight)
    _, _, coefficients_key = load_coefficients(opened, row, run)
    inputs = {"coefficients": coefficients_key, "database": database_document_sha256(database)}
    settings = {"library": library.sha256, "tracing": library.settings.sha256}
    if flight in library.stall:
        settings["stall"] = str(library.stall[flight])
    if flight in library.loops:
        settings["loop"] = str(library.loops[flight])
    key = result_key(inputs, settings, "gram", RESULT_VERSION["gram"])
    path = opened.path_of(key)
    if path is not None:
        return read_gram(path)
    made = gram(evidence_beside(opened, flight, database, library, run), library.settings)
    path = opened.workspace.result_path(key)
    write_gram(path, made)
    opened.keep_result(
        key,
        path,
        step="gram",
        kind="gram",
        flight=row.id,
        settings=settings,
        result_version=RESULT_VERSION["gram"],
        code_version=code_version(),
        inputs=inputs.values(),
        run=run,
    )
    return made


def evidence_beside(opened: Stores, flight: str, database: AeroDatabase, library: Library, run: str) -> Evidence:
    """The evidence of a flight (its id) beside a database that need not be stored: with its copies of more state noise, the
    companions of its columns, and what its commands say of them."""
    row = opened.catalogue.flight(flight)
    vehicle, _ = opened.vehicle(row.vehicle)
    whole, beside_whole, _ = beside(opened, flight, database, run)
    channels, comparison = thinned(whole, beside_whole, library.settings.bandwidth)
    document = load_consistent(opened, row, run)[1]
    noise, reconstructed = noise_of(document), reconstructed_angles(document)
    view = view_of(channels, comparison, database, vehicle)
    if "alpha" in reconstructed:
        view = replace(view, air_data_arm=np.zeros_like(view.cg))  # the angles are those at the CG, from the motion there
        noise = None if noise is None else bounded_noise(noise, view, comparison, library.settings)
    copies, near = library.settings.noisy_copies, None
    if whole.duration >= LONG:
        copies, near = min(copies, 1), comparison
    noisy = [] if noise is None else noisy_copies(channels, noise, database, vehicle, copies, near)
    hypotheses = columns_of(library.hypotheses, reconstructed)
    evidence = evidence_of(channels, comparison, database, vehicle, hypotheses, noisy, view)
    evidence = with_shapes(evidence, channels, library.hypotheses)
    commanded = as_commanded(channels, library.settings.bandwidth)
    if commanded is not None:
        asked = evidence_of(commanded, comparison, database, vehicle, hypotheses)
        evidence = with_instruments(evidence, with_shapes(asked, commanded, library.hypotheses))
    return evidence


def thinned_beside(opened: Stores, flight: str, database: AeroDatabase, library: Library, run: str) -> tuple[Flight, Comparison]:
    """A flight (its id) at the rate that tracing needs, and its comparison with a database that need not be stored."""
    channels, comparison, _ = beside(opened, flight, database, run)
    return thinned(channels, comparison, library.settings.bandwidth)


def looked_before(opened: Stores, flights: tuple[str, ...], library: Library) -> frozenset[str] | None:
    """Hypotheses that all earlier libraries had with which these flights were traced; None when they never were."""
    known: frozenset[str] | None = None
    for flight in flights:
        for result in opened.catalogue.results_of(flight, "gram"):
            if result.settings["library"] != library.sha256:
                ids = frozenset(read_gram(opened.file_of(result.path)).hypotheses)
                known = ids if known is None else known & ids
    return known


def only_what_was_frozen(traced: Traced, known: frozenset[str] | None) -> tuple[Traced, tuple[str, ...]]:
    """The findings with those that an earlier look could have suggested downgraded: a hypothesis that joined the library after
    these flights had been traced has no error rate."""
    if known is None:
        return traced, ()
    remark = "These flights were traced before with another library: what joined it since is suspected at most."
    late = [f.hypothesis not in known and f.verdict == "confirmed" for f in traced.findings]
    findings = tuple(_late(f) if is_late else f for f, is_late in zip(traced.findings, late, strict=True))
    return replace(traced, findings=findings), (remark,)


def _late(finding: Finding) -> Finding:
    because = f"{finding.because}; but it joined the library after these flights had been looked at"
    return replace(finding, verdict="suspected", because=because)
