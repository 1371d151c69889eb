"""Which OpenCL drivers the process sees: the system's, else one that pip installed."""

from __future__ import annotations

import os
import sys
import threading
from pathlib import Path

from ._abi import lib

_done = False
_lock = threading.Lock()


def prepare() -> None:
    """Once, before OpenCL is used first."""
    global _done
    with _lock:
        if _done:
            return
        _done = True
        lib.prepare_process()


def hint() -> str:
    """What else to install where there is no device; "" for nothing."""
    return ""
