"""PostgreSQL, an object store and a Dask cluster together: from logs to proof by commands, while a
worker is killed."""

from pathlib import Path

import pytest

from aerodb.storage.catalogue.catalogue import Catalogue
from aerodb.storage.upkeep.verification import verify
from tests.support.clusters import cluster
from tests.support.end_to_end import by_commands, same_as_direct
from tests.support.glider_runs import prepared
from tests.support.postgresql import Server, name_in_settings
from tests.support.shared_workspace import SharedWorkspaces

pytest.importorskip("distributed", reason="Dask is not installed (aerodb[dask])")
pytest.importorskip("moto", reason="no object store to test with (moto)")


@pytest.mark.campaign
def test_all_three_together_store_the_same_though_a_worker_is_killed(
    tmp_path: Path, postgresql_server: Server, logs: list[Path], shared: SharedWorkspaces
) -> None:
    """kill -9 as soon as the first flight's file is an object."""
    from tests.support.object_service import object_service

    direct = shared.updated(tmp_path / "here")
    (tmp_path / "dask").mkdir()
    database = postgresql_server.empty()
    with object_service() as service, cluster(tmp_path / "dask") as dask:
        store = f"s3://{service.bucket()}/scaled"
        more = f'{dask.settings()}[store]\nurl = "{store}"\n'
        name_in_settings(tmp_path / "w", postgresql_server.url(database), more)
        workspace = prepared(tmp_path / "w", logs[0].parent)
        with dask.one_killed(
            when=lambda: any(name.startswith("flights/") for name in service.names(store))
        ) as killed:
            done = by_commands(workspace.root, logs[0].parent, logs[::-1], "--direct")
        assert killed
        same_as_direct(workspace, done, direct)
        assert not list(workspace.root.glob("catalogue.sqlite*"))
        with Catalogue.open(workspace.catalogue) as catalogue:
            report = verify(workspace, catalogue)
        assert not report.problems
    postgresql_server.drop(database)
