"""Where files stand that tests read or run from."""

from pathlib import Path
from typing import Final

#: The checkout: what tests start as a process runs from here.
ROOT: Final = Path(__file__).resolve().parents[2]
#: Vehicle files and increment models of the measured aircraft.
VEHICLES: Final = Path(__file__).resolve().parent / "vehicles"
