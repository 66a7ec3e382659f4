from .jsbsim_executive import jsbsim_is_installed, loaded_in_jsbsim
from .prov import prov_json
from .ulog import write_ulog

__all__ = ["jsbsim_is_installed", "loaded_in_jsbsim", "prov_json", "write_ulog"]
