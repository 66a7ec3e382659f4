from .backup import back_up, restore
from .problems import Problem, VerificationReport, report_lines
from .verification import verify

__all__ = ["Problem", "VerificationReport", "back_up", "report_lines", "restore", "verify"]
