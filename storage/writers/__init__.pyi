from .jsbsim_executive import jsbsim_is_installed
from .jsbsim_process import agreement_in_jsbsim
from .prov import prov_json
from .ulog import write_ulog

__all__ = ["agreement_in_jsbsim", "jsbsim_is_installed", "prov_json", "write_ulog"]
