"""Lineage: the flights, logs, inputs and runs behind a version, and the versions that depend on a
flight."""

import sqlalchemy as sa

from aerodb.storage import encoding as enc
from aerodb.storage.catalogue import schema as s
from aerodb.storage.catalogue.ledger import Ledger
from aerodb.storage.catalogue.rows import FlightRole, Impact, Lineage, Role
from aerodb.storage.catalogue.version_queries import flights_of, headers, line, no_version, roles_of


class LineageLedger(Ledger):
    """Catalogue queries about the lineage of versions."""

    def version_flights(self, version: str) -> tuple[FlightRole, ...]:
        """Return the role of each flight in this version itself (not in its ancestors), by flight
        id."""
        c = s.version_flights.c
        with self._database.reading() as connection:
            rows = connection.execute(
                sa.select(c.flight, c.role, c.reason).where(c.version == version).order_by(c.flight)
            )
            return tuple(FlightRole(*row) for row in rows)

    def roles_in_line(self, version: str | None) -> dict[str, Role]:
        """Return flight -> strongest role in `version` (its id) and all its ancestors; empty for
        None, and without an error for an unknown id."""
        with self._database.reading() as connection:
            return roles_of(connection, version)

    def impact(self, flight: str) -> tuple[Impact, ...]:
        """Return the versions that depend on a flight (its id), ancestors first: those that used it
        for identification or validation, and all their descendants, each with its nearest use.
        UnknownNameError for an unknown flight; tables `version_flights` and `versions`."""
        c = s.version_flights.c
        with self._database.reading() as connection:
            self._require_flight(connection, flight)
            uses = connection.execute(
                sa.select(c.version, c.role).where(c.flight == flight, c.role != "excluded")
            ).all()
            rows = headers(
                connection, s.versions.c.id.in_(line([use.version for use in uses], down=True))
            )
        own: dict[str, Role] = {use.version: use.role for use in uses}
        impacts: dict[str, Impact] = {}
        for row in rows:  # a parent's number is always below its children's
            if row.id in own:
                impacts[row.id] = Impact(row, own[row.id], row.id)
            elif row.parent is not None:
                above = impacts[row.parent]
                impacts[row.id] = Impact(row, above.role, above.through)
        return tuple(impacts.values())

    def lineage(self, version: str) -> Lineage:
        """Return ancestors, flights, log hashes, inputs and runs behind a version (its id), as a
        `Lineage`; UnknownNameError where there is none."""
        v, e = s.versions.c, s.version_inputs.c
        whole = line([version])
        with self._database.reading() as connection:
            rows = headers(connection, v.id.in_(whole))
            if not rows:
                raise no_version(version)
            roles = roles_of(connection, version)
            logs = connection.execute(
                sa.select(s.flights.c.id, s.flights.c.log_sha256).where(
                    s.flights.c.id.in_(flights_of(whole))
                )
            )
            inputs: dict[str, list[str]] = {}
            for edge in connection.execute(
                sa.select(e.version, e.input_key).where(e.version.in_(whole)).order_by(e.input_key)
            ):
                inputs.setdefault(edge.version, []).append(edge.input_key)
            noted = sa.select(s.run_versions.c.run).where(s.run_versions.c.version.in_(whole))
            runs = connection.execute(
                sa.select(s.runs).where(s.runs.c.id.in_(noted)).order_by(s.runs.c.started_utc)
            )
            return Lineage(
                version=next(row for row in rows if row.id == version),
                line=tuple(reversed(rows)),
                roles=roles,
                logs={row.id: row.log_sha256 for row in logs},
                inputs={key: tuple(values) for key, values in inputs.items()},
                runs=tuple(self._run_row(row) for row in runs),
            )

    def steps_behind(self, version: str) -> dict[str, tuple[int, ...]]:
        """Return step -> `RESULT_VERSION`s of all results that a version (its id), not its
        ancestors, was made from."""
        edge, result = s.result_inputs.c, s.results.c
        keys = sa.select(s.version_inputs.c.input_key.label("key")).where(
            s.version_inputs.c.version == version
        )
        behind = keys.cte("behind", recursive=True)
        behind = behind.union(sa.select(edge.input_key).where(edge.key == behind.c.key))
        query = (
            sa.select(result.step, result.result_version)
            .join(behind, behind.c.key == result.key)
            .distinct()
        )
        by_step: dict[str, list[int]] = {}
        with self._database.reading() as connection:
            for row in connection.execute(query.order_by(result.step, result.result_version)):
                by_step.setdefault(row.step, []).append(row.result_version)
        return {step: tuple(numbers) for step, numbers in by_step.items()}

    def stale(self, version: str) -> tuple[str, ...]:
        """Return why a version (its id) is stale: one sentence per retracted flight that it or an
        ancestor used; empty if it is not."""
        c = s.flight_events.c
        with self._database.reading() as connection:
            roles = roles_of(connection, version)
            query = sa.select(c.flight, c.at_utc, c.reasons, s.flights.c.name).join(
                s.flights, s.flights.c.id == c.flight
            )
            used = c.flight.in_(flights_of(line([version])))
            rows = connection.execute(
                query.where(c.kind == "retracted", used).order_by(c.sequence)
            ).all()
        return tuple(
            f"flight {row.name or row.flight[:12]} ({roles[row.flight].replace('_', ' ')}) was"
            f" retracted on {row.at_utc[:10]}: {enc.from_json(row.reasons)[0]}"
            for row in rows
            if roles[row.flight] != "excluded"
        )
