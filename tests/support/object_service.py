"""A real S3 service (moto's server) on this machine, which tests can stop and start again; what it
holds outlives that."""

import logging
import os
import secrets
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import boto3
from moto.server import ThreadedMotoServer


class ObjectService:
    """The service and, beside the product's own way to it, a client of another make that looks at
    it and spoils things in it."""

    def __init__(self) -> None:
        self._server = ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
        self._server.start()
        self._port = self._server.get_host_and_port()[1]
        self.environment = {
            "AWS_ENDPOINT_URL": f"http://127.0.0.1:{self._port}",
            "AWS_ACCESS_KEY_ID": "aerodb",
            "AWS_SECRET_ACCESS_KEY": secrets.token_hex(20),
            "AWS_DEFAULT_REGION": "eu-central-1",
            "AWS_EC2_METADATA_DISABLED": "true",
        }
        self.client: Any = boto3.client(
            "s3",
            endpoint_url=self.environment["AWS_ENDPOINT_URL"],
            aws_access_key_id="aerodb",
            aws_secret_access_key="other",
            region_name="eu-central-1",
        )

    def bucket(self) -> str:
        """The name of a new, empty bucket."""
        name = f"aerodb-{secrets.token_hex(6)}"
        self.client.create_bucket(
            Bucket=name, CreateBucketConfiguration={"LocationConstraint": "eu-central-1"}
        )
        return name

    def names(self, url: str) -> list[str]:
        """What is below ``s3://bucket/prefix``, without the prefix; not the library's marks of
        folders."""
        bucket, _, prefix = url.removeprefix("s3://").partition("/")
        pages = self.client.get_paginator("list_objects_v2").paginate(Bucket=bucket, Prefix=prefix)
        keys = [entry["Key"] for page in pages for entry in page.get("Contents", ())]
        return sorted(key.removeprefix(f"{prefix}/") for key in keys if not key.endswith("/"))

    def at(self, url: str, name: str) -> dict[str, str]:
        """Bucket and key of an object, as the client's calls take them."""
        bucket, _, prefix = url.removeprefix("s3://").partition("/")
        return {"Bucket": bucket, "Key": f"{prefix}/{name}"}

    def delete(self, url: str, name: str) -> None:
        self.client.delete_object(**self.at(url, name))

    def spoil(self, url: str, name: str) -> None:
        """One bit of an object is another one from now on; its size is the same."""
        held = bytearray(self.client.get_object(**self.at(url, name))["Body"].read())
        held[len(held) // 2] ^= 1
        self.client.put_object(**self.at(url, name), Body=bytes(held))

    def stop(self) -> None:
        self._server.stop()

    def start(self) -> None:
        self._server = ThreadedMotoServer(ip_address="127.0.0.1", port=self._port, verbose=False)
        self._server.start()


@contextmanager
def object_service() -> Iterator[ObjectService]:
    """A service of its own, with the environment that leads to it; other credentials of whoever
    runs the tests are put away."""
    logging.getLogger("werkzeug").setLevel(logging.ERROR)
    before = {name: value for name, value in os.environ.items() if name.startswith("AWS_")}
    for name in before:
        del os.environ[name]
    service = ObjectService()
    os.environ.update(service.environment)
    try:
        yield service
    finally:
        service.stop()
        for name in service.environment:
            os.environ.pop(name, None)
        os.environ.update(before)
