"""One file as an object of a real S3 service: stored completely or not at all, with the bytes that
were written."""

import hashlib
import io
import random
import socket
import threading
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest

from aerodb.errors import InputError, StoreBusyError, StoreError
from aerodb.storage.catalogue.file_identity import StoredFile
from aerodb.storage.files.objects import Objects, objects_of, opened
from aerodb.storage.workspace_settings import SettingsError, load_settings
from tests.support.object_service import ObjectService

PLACE = f"results/ab/{'ab' * 32}.parquet"


@pytest.fixture
def objects(service: ObjectService) -> Objects:
    return opened(f"s3://{service.bucket()}/of/gliders", service.environment)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """More than two parts of a multipart upload, none of it compressible."""
    made = tmp_path / "file"
    made.write_bytes(random.Random(6).randbytes(12_000_001))
    return made


def others(folder: Path) -> list[str]:
    return sorted(entry.name for entry in folder.iterdir())


@pytest.mark.parametrize("size", [0, 1, 70_000, 12_000_001])
def test_another_client_finds_the_bytes_under_their_own_hash(
    service: ObjectService, objects: Objects, path: Path, tmp_path: Path, size: int
) -> None:
    data = path.read_bytes()[:size]
    path.write_bytes(data)
    stored = objects.put(path, PLACE)
    assert stored == StoredFile(PLACE, hashlib.sha256(data).hexdigest(), size)
    assert service.names(objects.url) == [f"{PLACE}.{stored.sha256}"]
    assert (
        service.client.get_object(**service.at(objects.url, f"{PLACE}.{stored.sha256}"))[
            "Body"
        ].read()
        == data
    )
    assert objects.has(stored)
    assert objects.fetch(stored, tmp_path / "deep" / "er" / "fetched")
    assert (tmp_path / "deep" / "er" / "fetched").read_bytes() == data
    assert objects.folders("results") == ["results/ab"]
    assert [file for file, _ in objects.below("results/ab").values()] == [stored]


def test_what_is_there_whole_is_not_sent_again_and_what_is_half_there_is(
    service: ObjectService, objects: Objects, path: Path
) -> None:
    stored = objects.put(path, PLACE)
    there = service.at(objects.url, f"{PLACE}.{stored.sha256}")
    tagged = service.client.put_object_tagging(
        **there, Tagging={"TagSet": [{"Key": "first", "Value": "yes"}]}
    )
    assert tagged["ResponseMetadata"]["HTTPStatusCode"] == 200
    objects.put(path, PLACE)
    assert service.client.get_object_tagging(**there)["TagSet"], (
        "an object that is sent again loses its tags"
    )
    service.client.put_object(**there, Body=path.read_bytes()[:-1])
    assert not objects.has(stored)
    objects.put(path, PLACE)
    assert service.client.get_object(**there)["Body"].read() == path.read_bytes()


def test_what_is_too_large_to_be_copied_is_sent_in_place(
    service: ObjectService, objects: Objects, path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("aerodb.storage.files.objects._COPIED", 5_000_000)
    stored = objects.put(path, PLACE)
    assert service.names(objects.url) == [f"{PLACE}.{stored.sha256}"]
    assert b"".join(objects.blocks(stored) or ()) == path.read_bytes()


def test_nothing_there_is_no_error_and_leaves_nothing(objects: Objects, tmp_path: Path) -> None:
    stored = StoredFile(PLACE, "cd" * 32, 10)
    assert not objects.has(stored)
    assert not objects.fetch(stored, tmp_path / "f" / "x")
    assert objects.below("results/ab") == {}
    assert objects.folders("results") == []
    assert others(tmp_path) == []


def test_a_changed_object_is_refused_by_its_hash(
    service: ObjectService, objects: Objects, path: Path, tmp_path: Path
) -> None:
    stored = objects.put(path, PLACE)
    service.spoil(objects.url, f"{PLACE}.{stored.sha256}")
    (tmp_path / "new").mkdir()
    (tmp_path / "new" / "kept").write_bytes(b"as it was")
    with pytest.raises(StoreError, match="differ from those that were stored") as caught:
        objects.fetch(stored, tmp_path / "new" / "kept")
    assert not isinstance(caught.value, StoreBusyError)
    assert caught.value.where == objects.address(stored)
    assert (tmp_path / "new" / "kept").read_bytes() == b"as it was"
    assert others(tmp_path / "new") == ["kept"]


def test_a_file_that_is_not_the_one_that_was_meant_is_not_sent(
    service: ObjectService, objects: Objects, path: Path
) -> None:
    with pytest.raises(InputError, match="changed while it was read"):
        objects.put(path, PLACE, "cd" * 32)
    assert service.names(objects.url) == []


def test_no_bucket_is_said_and_never_taken_for_no_object(
    service: ObjectService, path: Path, tmp_path: Path
) -> None:
    nowhere = opened("s3://there-is-none/of/it", service.environment)
    stored = StoredFile(PLACE, "cd" * 32, 10)
    calls = [
        lambda: nowhere.put(path, PLACE),
        lambda: nowhere.fetch(stored, tmp_path / "x"),
        lambda: nowhere.has(stored),
        lambda: nowhere.folders("results"),
        lambda: nowhere.below("results/ab"),
    ]
    for call in calls:
        with pytest.raises(StoreError, match="the bucket does not exist") as caught:
            call()
        assert not isinstance(caught.value, StoreBusyError)
        assert "create the bucket" in caught.value.remedy


def test_who_has_no_right_is_told_what_to_do(
    service: ObjectService, objects: Objects, path: Path, tmp_path: Path
) -> None:
    stored = StoredFile(PLACE, "cd" * 32, 10)
    with _rights_asked_for(service):
        for call in (
            lambda: objects.put(path, PLACE),
            lambda: objects.fetch(stored, tmp_path / "x"),
            lambda: objects.folders("a"),
        ):
            with pytest.raises(StoreError, match="refuses access") as caught:
                call()
            assert not isinstance(caught.value, StoreBusyError)
            assert "$AWS_ACCESS_KEY_ID" in caught.value.remedy
            assert service.environment["AWS_SECRET_ACCESS_KEY"] not in str(caught.value)
    objects.put(path, PLACE)


@pytest.mark.parametrize("size", [7, 300, 5000], ids=lambda n: f"{n} bytes")
def test_an_archived_object_is_refused_however_small_it_is(
    objects: Objects, service: ObjectService, tmp_path: Path, size: int
) -> None:
    """The answer of the service is longer than a small object, and does not fit its buffer."""
    (tmp_path / "small").write_bytes(bytes(size))
    stored = objects.put(tmp_path / "small", "small")
    where = service.at(objects.url, f"small.{stored.sha256}")
    service.client.put_object(**where, Body=bytes(size), StorageClass="GLACIER")
    with pytest.raises(StoreError, match="refuses access") as caught:
        objects.fetch(stored, tmp_path / "again")
    assert not isinstance(caught.value, StoreBusyError)
    assert "archived object" in str(caught.value)
    assert not (tmp_path / "again").exists()


@contextmanager
def _rights_asked_for(service: ObjectService) -> Iterator[None]:
    """The service asks who its clients are from now on, and knows none."""

    def free(calls: bytes) -> None:
        url, kind = (
            f"{service.environment['AWS_ENDPOINT_URL']}/moto-api/reset-auth",
            {"content-type": "text/plain"},
        )
        urllib.request.urlopen(urllib.request.Request(url, data=calls, headers=kind)).close()

    free(b"0")
    try:
        yield
    finally:
        free(b"inf")


def test_a_service_that_is_away_is_busy_and_works_when_it_is_back(
    service: ObjectService, objects: Objects, path: Path, tmp_path: Path
) -> None:
    stored = objects.put(path, PLACE)
    service.stop()
    try:
        for call in (
            lambda: objects.fetch(stored, tmp_path / "x"),
            lambda: objects.put(path, f"{PLACE}x"),
        ):
            with pytest.raises(StoreBusyError, match="cannot be reached"):
                call()
        assert others(tmp_path) == ["file"]
    finally:
        service.start()
    assert objects.fetch(stored, tmp_path / "x")
    objects.put(path, f"{PLACE}x")


def test_a_file_that_cannot_be_read_to_its_end_leaves_no_half_object(
    service: ObjectService, objects: Objects, path: Path
) -> None:
    """What closes the library's stream completes the upload, also when it is an error that closes
    it."""

    class Broken(io.BytesIO):
        def read(self, size: int | None = -1) -> bytes:
            if self.tell():
                raise OSError(5, "Input/output error")
            return super().read(size)

    data = path.read_bytes()
    with pytest.raises(OSError, match="Input/output"):
        objects._upload(
            Broken(data), StoredFile(PLACE, hashlib.sha256(data).hexdigest(), len(data))
        )
    assert service.names(objects.url) == []


@pytest.mark.parametrize("size", [70_000, 12_000_001])
def test_an_upload_that_fails_leaves_another_writers_object_of_the_same_name(
    objects: Objects, path: Path, size: int
) -> None:
    """Both began when there was none; the other has put all of it before this one ends half-way."""
    data = path.read_bytes()[:size]
    path.write_bytes(data)

    class Overtaken(io.BytesIO):
        def read(self, size: int | None = -1) -> bytes:
            if self.tell() or len(data) < 100_000:
                objects.put(path, PLACE)
                raise KeyboardInterrupt
            return super().read(size)

    stored = StoredFile(PLACE, hashlib.sha256(data).hexdigest(), len(data))
    with pytest.raises(KeyboardInterrupt):
        objects._upload(Overtaken(data), stored)
    assert b"".join(objects.blocks(stored) or ()) == data
    assert [file for file, _ in objects.below("results/ab").values()] == [stored]


@contextmanager
def wire(target: int, until: int) -> Iterator[int]:
    """A port in front of the local one `target`; both ways of all connections are cut after so many
    bytes, and new ones, too."""
    listening, passed, ended = socket.create_server(("127.0.0.1", 0)), [0], threading.Event()
    held: list[socket.socket] = []

    def pump(source: socket.socket, sink: socket.socket) -> None:
        with suppress(OSError):
            while block := source.recv(65536):
                passed[0] += len(block)
                if passed[0] > until:
                    for each in held:
                        with suppress(OSError):  # it may be closed already
                            each.shutdown(socket.SHUT_RDWR)
                    return
                sink.sendall(block)

    def accept() -> None:
        with suppress(OSError):
            while not ended.is_set():
                near, far = listening.accept()[0], socket.create_connection(("127.0.0.1", target))
                held.extend((near, far))
                for pair in ((near, far), (far, near)):
                    threading.Thread(target=pump, args=pair, daemon=True).start()

    thread = threading.Thread(target=accept, daemon=True)
    thread.start()
    try:
        yield listening.getsockname()[1]
    finally:
        ended.set()
        listening.close()


@pytest.mark.parametrize("until", [2_000, 9_000_000])
def test_a_connection_that_is_cut_leaves_no_half_object(
    service: ObjectService, objects: Objects, path: Path, until: int
) -> None:
    port = int(service.environment["AWS_ENDPOINT_URL"].rpartition(":")[2])
    with wire(port, until) as cut:
        through = opened(
            objects.url, {**service.environment, "AWS_ENDPOINT_URL": f"http://127.0.0.1:{cut}"}
        )
        with pytest.raises(StoreBusyError, match="cannot be reached"):
            through.put(path, PLACE)
    assert service.names(objects.url) == []
    assert objects.has(objects.put(path, PLACE))


NOWHERE = [
    "localhost:9000",
    "ftp://host",
    "http://",
    "https://me:secret@host",
    "https://host/path",
    "http://[::1",
    "http://h:99999",
]


@pytest.mark.parametrize("address", NOWHERE)
def test_an_endpoint_that_is_none_is_said(service: ObjectService, address: str) -> None:
    with pytest.raises(StoreError, match="not an address") as caught:
        opened("s3://bucket", {**service.environment, "AWS_ENDPOINT_URL": address})
    assert "secret" not in str(caught.value)


GOOD = ["s3://bucket", "s3://my.bucket-1/", "s3://bucket/a/B_c.d-1/e"]
BAD = [
    "bucket",
    "https://host/b",
    "s3://",
    "s3://b",
    "s3://Bucket",
    "s3://bucket/../x",
    "s3://bucket//x",
    "s3://bucket/a b",
]


@pytest.mark.parametrize("url", GOOD)
def test_settings_name_the_store(tmp_path: Path, service: ObjectService, url: str) -> None:
    (tmp_path / "settings.toml").write_text(f'[store]\nurl = "{url}"\ncache = 5\n')
    assert load_settings(tmp_path).store.url == url.rstrip("/")
    made = objects_of(tmp_path)
    assert made is not None
    assert made.url == url.rstrip("/")


@pytest.mark.parametrize(
    "url", [*BAD, "s3://key:the-secret@bucket", "s3://bucket?secret_key=the-secret"]
)
def test_settings_that_name_none_are_refused_without_repeating_a_secret(
    tmp_path: Path, url: str
) -> None:
    (tmp_path / "settings.toml").write_text(f'[store]\nurl = "{url}"\n')
    for read in (load_settings, objects_of):
        with pytest.raises(SettingsError, match="s3://BUCKET/PREFIX") as caught:
            read(tmp_path)
        assert "the-secret" not in str(caught.value)


def test_no_settings_or_none_about_it_mean_the_folder(tmp_path: Path) -> None:
    assert objects_of(tmp_path) is None
    (tmp_path / "settings.toml").write_text("[inbox]\nattempts = 5\n")
    assert objects_of(tmp_path) is None
    (tmp_path / "settings.toml").write_text("[inbox\n")
    with pytest.raises(SettingsError, match="cannot be read"):
        objects_of(tmp_path)
    (tmp_path / "settings.toml").unlink()
    (tmp_path / "settings.toml").symlink_to(
        tmp_path / "settings.toml"
    )  # it is there, and nobody can read it
    with pytest.raises(SettingsError, match="cannot be read"):
        objects_of(tmp_path)
