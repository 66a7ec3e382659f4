from . import verify
from .backup import back_up, restore

__all__ = ["back_up", "restore", "verify"]
