"""Writers of external formats: ULog, PROV-JSON, and JSBSim as the receiver of an export.

`write_ulog` writes topics as a PX4 log file; the example flights and the benchmarks use it, so that
they are read like any other log. `prov_json` gives the lineage of a version as W3C PROV-JSON.
`agreement_in_jsbsim` runs JSBSim in another process and compares an exported aircraft file with its
database there, where JSBSim is installed (`jsbsim_is_installed`).

Modules: `ulog`, `prov`, `jsbsim_executive` (loads the file), `jsbsim_process` (the other process).
"""

from typing import TYPE_CHECKING

from aerodb.lazy_faces import attach

if TYPE_CHECKING:
    from .jsbsim_executive import jsbsim_is_installed
    from .jsbsim_process import agreement_in_jsbsim
    from .prov import prov_json
    from .ulog import write_ulog

__getattr__, __dir__, __all__ = attach(__name__, __file__)
