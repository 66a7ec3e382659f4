"""Measured records as flights, through the built-in mappings, and which of them there are."""

from pathlib import Path

from aerodb.flight import Flight
from aerodb.logs.mapping import choose_mapping, map_recording
from aerodb.storage.mappings import builtin_mappings
from aerodb.storage.readers.tabular import read_tabular
from aerodb.vehicle import parse_vehicle

VEHICLE = """
name = "any"
[reference]
area = 10.0
chord = 1.0
span = 10.0
[points]
moment_reference = "cg"
[mass]
source = "channels"
"""
ATTAS = tuple(
    f"attas/{name}"
    for name in ("fAttasElv1.mat", "fAttasAil1.mat", "fAttasRud1.mat", "fAttasAilRud1.mat")
)
STALLS = ("attas/fAttas_qst01.asc", "attas/fAttas_qst02.asc")
TWIN_OTTER = tuple(f"twin_otter/totter_{name}_data.mat" for name in ("f1_017", "9752ed20", "demo"))
HFB320, CITATION = "hfb320/hfb320_1_10.asc", "citation/flight_2019-03-12.parquet"
RECORDS = (*ATTAS, *STALLS, *TWIN_OTTER, HFB320, CITATION)


def as_flight(path: Path) -> Flight:
    """The record at `path` as a flight named by its file."""
    recording = read_tabular(path)
    mapping = choose_mapping(recording, builtin_mappings().values())
    return map_recording(recording, mapping, parse_vehicle(VEHICLE), path.stem)
