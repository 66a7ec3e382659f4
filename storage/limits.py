"""Resource limits of a run: section ``[limits]`` of the workspace settings.

Logs are untrusted: forty bytes of a header can declare ten gigabytes.
"""

from pydantic import Field

from aerodb.errors import InputError
from aerodb.quantities import Seconds
from aerodb.support import Strict


class Limits(Strict):
    """Resource limits.

    For one log: its `size` [bytes]. For parsing it, and again for each further step on it: the
    `memory` in addition to code [bytes], `processor` time [s] and elapsed time `wall` [s]. For a
    run: free disk space to leave (`reserve`) [bytes], duration of one `step` under Prefect [s],
    duration of the whole `run` [s].
    """

    size: int = Field(default=20_000_000_000, gt=0)
    memory: int = Field(default=4_000_000_000, gt=0)
    processor: Seconds = Field(default=600.0, ge=1.0)
    wall: Seconds = Field(default=1800.0, gt=0.0)
    reserve: int = Field(default=200_000_000, ge=0)
    step: Seconds = Field(default=7200.0, gt=0.0)
    run: Seconds = Field(default=172_800.0, gt=0.0)

    def check_size(self, size: int, log: str) -> None:
        """Raise InputError when a log of `size` [bytes] exceeds the limit."""
        if size > self.size:
            what = f"its size is {size / 1e6:.0f} MB, the limit is {self.size / 1e6:.0f} MB"
            raise InputError(
                what, log, "split the log, or raise [limits] size in the workspace settings"
            )
