"""HDF5 files whose samples are those of another file: external storage, links and virtual datasets
are refused by name and place, and no byte of the other file is read."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from aerodb.errors import InputError
from aerodb.storage.limits import Limits
from aerodb.storage.readers import read_log
from aerodb.tasks.workers.parsing import parsed_log


def _external(file: Any, secret: Path) -> None:
    file.create_dataset("a/leak", (8,), "u1", external=[(str(secret), 0, 8)])


def _external_link(file: Any, secret: Path) -> None:
    file["a/leak"] = h5py.ExternalLink(str(secret), "/x")


def _soft_link(file: Any, _: Path) -> None:
    file["a/leak"] = h5py.SoftLink("/time")


def _virtual(file: Any, secret: Path) -> None:
    layout = h5py.VirtualLayout((8,), "f8")
    layout[:] = h5py.VirtualSource(str(secret), "x", (8,))
    file.create_virtual_dataset("a/leak", layout)


def _referred(file: Any, secret: Path) -> None:
    text = file.create_dataset("#refs#/b", (8,), "u2", external=[(str(secret), 0, 16)])
    text.attrs["MATLAB_class"] = np.bytes_(b"char")
    cell = file.create_dataset("a/leak", (1, 1), h5py.ref_dtype)
    cell[0, 0] = text.ref
    cell.attrs["MATLAB_class"] = np.bytes_(b"cell")


@pytest.mark.parametrize("plant", [_external, _external_link, _soft_link, _virtual, _referred])
def test_samples_of_another_file_are_refused(
    tmp_path: Path, plant: Callable[[Any, Path], None]
) -> None:
    secret = tmp_path / "secret"
    secret.write_bytes(b"a secret that is no sample")
    path = tmp_path / "log.h5"
    with h5py.File(path, "w") as file:
        file["time"] = np.arange(100.0)
        file["x"] = np.sin(np.arange(100.0))
    assert read_log(path).topics
    with h5py.File(path, "a") as file:
        plant(file, secret)
    with pytest.raises(InputError, match=r"variable a\.leak ") as refused:
        read_log(path)
    assert refused.value.where == str(path)
    with (
        pytest.raises(InputError, match=r"variable a\.leak "),
        parsed_log(path, tmp_path / "place", Limits()),
    ):
        pass
