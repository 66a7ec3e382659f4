"""What a run may take of the machine: section ``[limits]`` of the workspace's settings.

Logs are untrusted: forty bytes of a header can declare ten gigabytes.
"""

from pydantic import Field

from aerodb.errors import InputError
from aerodb.quantities import Seconds
from aerodb.support import Strict


class Limits(Strict):
    """Of the parsing of one log: its `size` [bytes], the `memory` that its reader takes beside its
    own code [bytes], `processor` time and time on the `wall` clock [s]. Of a run: bytes of the disk
    that it leaves free (`reserve`), how long a `step` may take [s] when Prefect runs it, and how
    long all of the `run` [s]."""

    size: int = Field(default=20_000_000_000, gt=0)
    memory: int = Field(default=4_000_000_000, gt=0)
    processor: Seconds = Field(default=600.0, ge=1.0)
    wall: Seconds = Field(default=1800.0, gt=0.0)
    reserve: int = Field(default=200_000_000, ge=0)
    step: Seconds = Field(default=7200.0, gt=0.0)
    run: Seconds = Field(default=172_800.0, gt=0.0)

    def check_size(self, size: int, log: str) -> None:
        """InputError when a log of `size` [bytes] is not to be read."""
        if size > self.size:
            what = f"{size / 1e6:.0f} MB, and at most {self.size / 1e6:.0f} MB are read"
            raise InputError(
                what, log, "split the log, or set [limits] size in the workspace's settings"
            )
