"""Queries about runs: unresolved failures, newest runs, and what runs produced."""

from collections.abc import Iterable
from datetime import datetime, timedelta

import sqlalchemy as sa

from aerodb.storage import encoding as enc
from aerodb.storage.catalogue import schema as s
from aerodb.storage.catalogue.ledger import Ledger, in_parts
from aerodb.storage.catalogue.rows import RunRow

#: Maximum number of failed runs examined, and of completed runs of a flow compared with them.
_EXAMINED = 1000
_MAXIMUM_AGE = timedelta(days=30)
#: Parameters that two runs of a flow must share to have the same task; others (such as the list of
#: flights) may differ.
_SAME = ("vehicle", "logs", "log", "file", "version", "flight")


class RunQueries(Ledger):
    """Catalogue queries about runs."""

    def unresolved_runs(self, limit: int = 50) -> tuple[RunRow, ...]:
        """Return runs that failed or crashed, that nobody dismissed and that no later run of the
        same task completed, newest first. Failures older than 30 days are ignored (`RunRow`, times
        in UTC).
        """
        c, since = s.runs.c, enc.time_text(enc.now() - _MAXIMUM_AGE)
        dismissed = sa.exists().where(s.run_dismissals.c.run == c.id)
        query = sa.select(s.runs).where(
            c.state.in_(("failed", "crashed")), c.started_utc > since, ~dismissed
        )
        with self._database.reading() as connection:
            newest = query.order_by(c.started_utc.desc(), c.id).limit(_EXAMINED)
            failed = [self._run_row(row) for row in connection.execute(newest)]
        later = {
            flow: self._completed(flow, min(run.started_utc for run in failed))
            for flow in {run.flow for run in failed}
        }
        return tuple(
            run for run in failed if not any(_made_good(run, other) for other in later[run.flow])
        )[:limit]

    def _completed(self, flow: str, since: datetime | None = None) -> list[RunRow]:
        c = s.runs.c
        query = (
            sa.select(s.runs)
            .where(c.flow == flow, c.state == "completed")
            .order_by(c.started_utc.desc(), c.id)
        )
        if since is not None:
            query = query.where(c.started_utc > enc.time_text(since))
        with self._database.reading() as connection:
            return [self._run_row(row) for row in connection.execute(query.limit(_EXAMINED))]

    def last_completed(self, flow: str, vehicle: str) -> RunRow | None:
        """Return the newest completed run of a flow for a vehicle, or None without an error; by
        `runs`."""
        return next(
            (run for run in self._completed(flow) if run.parameters.get("vehicle") == vehicle), None
        )

    def runs_of(
        self, flows: Iterable[str], limit: int, before: tuple[datetime, str] | None = None
    ) -> tuple[RunRow, ...]:
        """The newest `limit` runs of these flows, newest first; before : only those that follow
        this start and id in the list."""
        c = s.runs.c
        runs: list[RunRow] = []
        with self._database.reading() as connection:
            for flow in flows:  # one after another: each is a stretch of an index
                query = sa.select(s.runs).where(c.flow == flow)
                if before is not None:
                    at = enc.time_text(before[0])
                    query = query.where(
                        c.started_utc <= at, (c.started_utc < at) | (c.id > before[1])
                    )
                rows = connection.execute(query.order_by(c.started_utc.desc(), c.id).limit(limit))
                runs += [self._run_row(row) for row in rows]
        runs.sort(key=lambda run: run.id)
        return tuple(sorted(runs, key=lambda run: run.started_utc, reverse=True)[:limit])

    def made_by(
        self, runs: Iterable[str], step: str
    ) -> dict[str, tuple[tuple[str, ...], tuple[str, ...]]]:
        """Return run (its id) -> ids of the versions, and keys of the results of `step`, that it
        made or used."""
        v, r, result = s.run_versions.c, s.run_results.c, s.results.c
        results: dict[str, tuple[list[str], list[str]]] = {run: ([], []) for run in runs}
        with self._database.reading() as connection:
            for part in in_parts(results):
                for row in connection.execute(sa.select(v.run, v.version).where(v.run.in_(part))):
                    results[row.run][0].append(row.version)
                query = sa.select(r.run, r.key).join(s.results, result.key == r.key)
                for row in connection.execute(query.where(r.run.in_(part), result.step == step)):
                    results[row.run][1].append(row.key)
        return {run: (tuple(versions), tuple(keys)) for run, (versions, keys) in results.items()}

    def first_run_with(self, key: str) -> RunRow | None:
        """The first run that made or used the result with this key; None where none did."""
        used = s.run_results.c
        query = (
            sa.select(s.runs)
            .join(s.run_results, used.run == s.runs.c.id)
            .where(used.key == key)
            .order_by(s.runs.c.started_utc, s.runs.c.id)
            .limit(1)
        )
        with self._database.reading() as connection:
            row = connection.execute(query).one_or_none()
        return None if row is None else self._run_row(row)

    def newest_run(self, flows: Iterable[str]) -> RunRow | None:
        """The newest run of any of these flows, however it ended."""
        c = s.runs.c
        query = (
            sa.select(s.runs)
            .where(c.flow.in_(list(flows)))
            .order_by(c.started_utc.desc(), c.id)
            .limit(1)
        )
        with self._database.reading() as connection:
            row = connection.execute(query).one_or_none()
        return None if row is None else self._run_row(row)


def _made_good(run: RunRow, other: RunRow) -> bool:
    return other.started_utc > run.started_utc and all(
        run.parameters.get(k) == other.parameters.get(k) for k in _SAME
    )
