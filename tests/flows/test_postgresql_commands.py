"""From logs to a proof and a release by commands, the same tests as on a file: the catalogue is in
PostgreSQL here."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import psycopg
import pytest

from tests.flows.test_cli import (
    from_logs_to_proof,
    test_a_version_is_shown_layered_or_consolidated,
    test_evaluate_gives_the_handbook_value_and_the_increment,
    test_queries_about_versions,
    test_update_answers_with_the_document_of_the_contract,
)
from tests.support.postgresql import Server, name_in_settings
from tests.tasks.test_promotion import test_from_candidate_to_released_and_back

__all__ = [
    "test_a_version_is_shown_layered_or_consolidated",
    "test_evaluate_gives_the_handbook_value_and_the_increment",
    "test_from_candidate_to_released_and_back",
    "test_queries_about_versions",
    "test_update_answers_with_the_document_of_the_contract",
]

#: What is written and read there, `tests/storage/catalogue` tests in every run.
pytestmark = pytest.mark.campaign


@pytest.fixture(scope="module")
def url(postgresql_server: Server) -> Iterator[str]:
    database = postgresql_server.empty()
    yield postgresql_server.url(database)
    postgresql_server.drop(database)


@pytest.fixture(scope="module")
def made(
    tmp_path_factory: pytest.TempPathFactory, url: str
) -> tuple[Path, list[Path], dict[str, Any]]:
    workspace = tmp_path_factory.mktemp("made") / "w"
    name_in_settings(workspace, url)
    return from_logs_to_proof(tmp_path_factory.mktemp("files"), workspace)


@pytest.fixture(scope="module")
def flown(made: tuple[Path, list[Path], dict[str, Any]]) -> tuple[Path, Path]:
    return made[0], made[1][0].parent


def test_the_rows_are_in_the_database_and_no_file_is_there(
    made: tuple[Path, list[Path], dict[str, Any]], url: str
) -> None:
    assert not list(made[0].glob("catalogue*"))
    with psycopg.connect(url) as raw:
        counted = raw.execute(
            "SELECT (SELECT count(*) FROM flights), (SELECT count(*) FROM versions WHERE number"
            " <= 2)"
        )
        assert counted.fetchone() == (6, 2)
