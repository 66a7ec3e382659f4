"""Writers of external formats: ULog, PROV-JSON, and JSBSim as the receiver of an export.

`write_ulog` writes topics as a PX4 log file; the example flights and the benchmarks use it, so that
they are read like any other log. `prov_json` gives the lineage of a version as W3C PROV-JSON.
`agreement_in_jsbsim` runs JSBSim in another process and compares an exported aircraft file with its
database there, where JSBSim is installed (`jsbsim_is_installed`).

Modules: `ulog`, `prov`, `jsbsim_executive` (loads the file), `jsbsim_process` (the other process).
"""

import lazy_loader as lazy

__getattr__, __dir__, __all__ = lazy.attach_stub(__name__, __file__)
