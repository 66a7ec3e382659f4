"""The inbox of a workspace: logs that wait to be ingested, quarantine, and outgoing notifications.

`scan_inbox` lists the files of the inbox as `InboxFile` with a state; `rescan_inbox` updates files
that were still being copied; `refuse_oversized` applies the size limit. `open_log` opens a log
without following links. A log that was ingested goes to the store with `archive_log` (its path:
`archived_path`); what cannot be read as a log goes to quarantine with `quarantine_unreadable`.
`newest_quarantined` lists quarantine, `return_to_inbox` takes an entry back.
`post_notification` queues a notification, `undelivered_notifications` lists the queue.

Modules: `folders` (inbox), `quarantined` (quarantine), `outbox` (notifications). What happened to
each file is recorded in `aerodb.storage.catalogue.inbox_history`.
"""

from typing import TYPE_CHECKING

from aerodb.lazy_faces import attach

if TYPE_CHECKING:
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

__getattr__, __dir__, __all__ = attach(__name__, __file__)
