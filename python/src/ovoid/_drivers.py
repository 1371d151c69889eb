"""Which OpenCL drivers a process sees: the system's, and where it has none, one that pip installed.

Stands alone, for the command `ovoid` reads it without the rest of the package.
"""

from __future__ import annotations

import os
import threading
from pathlib import Path

SYSTEM = "/etc/OpenCL/vendors"
_VARIABLES = ("OCL_ICD_VENDORS", "OCL_ICD_FILENAMES", "OPENCL_VENDOR_PATH")
# Distributions of PyPI that hold a driver which works, its library, and what that one needs, too.
_PACKAGED = (("intel-opencl-rt", "libintelocl.so", "intel-cmplr-lib-rt"),)

_done = False
_lock = threading.Lock()


def _packaged() -> str | None:
    """The library of a driver that pip installed beside this package, with all that it needs."""
    from importlib import metadata  # only here: it takes a tenth as long as importing numpy

    for name, library, needed in _PACKAGED:
        try:
            metadata.distribution(needed)
            files = metadata.distribution(name).files or []
        except metadata.PackageNotFoundError:
            continue
        for file in files:
            if file.name == library:
                path = Path(str(file.locate())).resolve()
                if path.exists():
                    return str(path)
    return None


def choose() -> None:
    """Where the system has no driver and the user named none, names that one to the loader."""
    if any(os.environ.get(name) for name in _VARIABLES):
        return
    if os.path.isdir(SYSTEM) and any(name.endswith(".icd") for name in os.listdir(SYSTEM)):
        return
    library = _packaged()
    if library is not None:
        os.environ["OCL_ICD_VENDORS"] = library  # ocl-icd takes a library there
        os.environ["OCL_ICD_FILENAMES"] = library  # Khronos' loader takes it here


def prepare() -> None:
    """Once, before OpenCL is used first."""
    global _done
    from ._abi import lib

    with _lock:
        if not _done:
            _done = True
            choose()
            lib.prepare_process()


def hint() -> str:
    """What else makes a device, as text for an error."""
    return (
        "pip install ovoid[intel] does, too: Intel's OpenCL runtime makes the CPU a device, "
        "of AMD processors as well (Linux, x86-64)."
    )
