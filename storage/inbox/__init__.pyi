from .folders import (
    InboxFile,
    archive_log,
    archived_path,
    may_settle,
    open_log,
    quarantine_unreadable,
    refuse_oversized,
    rescan_inbox,
    scan_inbox,
    unreadable_key,
)
from .outbox import post_notification, undelivered_notifications
from .quarantined import (
    REASON,
    Quarantined,
    count_quarantined,
    newest_quarantined,
    return_to_inbox,
)
from .uploads import Upload, receiving

__all__ = [
    "REASON",
    "InboxFile",
    "Quarantined",
    "Upload",
    "archive_log",
    "archived_path",
    "count_quarantined",
    "may_settle",
    "newest_quarantined",
    "open_log",
    "post_notification",
    "quarantine_unreadable",
    "receiving",
    "refuse_oversized",
    "rescan_inbox",
    "return_to_inbox",
    "scan_inbox",
    "undelivered_notifications",
    "unreadable_key",
]
