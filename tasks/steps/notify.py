"""Notifications by webhook or command, as the settings ask; a failed notification fails no run."""

import json
import os
import subprocess
import urllib.request
from collections.abc import Mapping
from http.client import HTTPException
from pathlib import Path
from typing import Any, Final
from urllib.error import HTTPError

from aerodb.storage.inbox import post_notification, undelivered_notifications
from aerodb.storage.workspace import Workspace
from aerodb.storage.workspace_settings import Notification, Occasion, load_settings

_SECONDS: Final = 15.0


def tell(
    workspace: Workspace, occasion: Occasion, vehicle: str, text: str, details: Mapping[str, Any]
) -> bool:
    """Queue a notification if the settings ask for it, and return whether they do."""
    receivers = load_settings(workspace.root).notification_of(vehicle)
    if occasion not in receivers.on or not (receivers.webhook or receivers.command):
        return False
    post_notification(workspace, occasion, vehicle, text, details)
    return True


def deliver(root: str, *, workspace: str, run: str) -> list[dict[str, str]]:
    """Deliver the queued notifications of the workspace folder `root`; a failed one stays queued.

    If a receiver could not be reached, it is not tried again in this call. Returns the failures:
    ``text`` of the notification and ``error``. Addresses may hold secrets and are never included.
    """
    folder = Workspace.open(Path(root))
    settings, failures = load_settings(folder.root), []
    failed: dict[tuple[str, tuple[str, ...]], str] = {}
    for path, message in undelivered_notifications(folder):
        target = settings.notification_of(message["vehicle"])
        reached = (target.webhook, target.command)
        error = failed.get(reached) or _send(target, message)
        if error:
            failed[reached] = error
            failures.append({"text": message["text"], "error": error})
        else:
            path.unlink(missing_ok=True)
    return failures


def _send(target: Notification, message: Mapping[str, Any]) -> str:
    """Send one message, and return why it failed; empty if it was sent or there is no receiver."""
    data = json.dumps(message).encode("utf-8")
    errors = []
    if target.webhook:
        errors.append(_to_webhook(target.webhook, data))
    if target.command:
        errors.append(_to_command(target.command, data))
    return "; ".join(filter(None, errors))


def _to_webhook(address: str, data: bytes) -> str:
    url = os.environ.get(address[1:], "") if address.startswith("$") else address
    if not url.startswith(("https://", "http://")):
        return f"webhook: {address} does not contain an http(s) address"
    try:
        request = urllib.request.Request(
            url, data, {"Content-Type": "application/json"}, method="POST"
        )
        with urllib.request.urlopen(request, timeout=_SECONDS):
            return ""
    except HTTPError as error:
        error.close()
        return f"webhook: the server answered {error.code}"
    except (OSError, ValueError, HTTPException) as error:
        return f"webhook: {type(error).__name__}"  # its text may hold the address or a part of it


def _to_command(command: tuple[str, ...], data: bytes) -> str:
    # The user's own script may import what lies beside it.
    environment = {n: value for n, value in os.environ.items() if n != "PYTHONSAFEPATH"}
    try:
        done = subprocess.run(
            command,
            input=data,
            env=environment,
            capture_output=True,
            timeout=_SECONDS,
            check=False,
        )
    except (OSError, subprocess.SubprocessError) as error:
        return f"command: {type(error).__name__}"
    tail = done.stderr[-300:].decode("utf-8", "replace").strip()
    return f"command: ended with {done.returncode}: {tail}" if done.returncode else ""
