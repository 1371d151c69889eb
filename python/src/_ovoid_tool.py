"""The command `ovoid`: becomes the tool that the package holds, without importing the package."""

from __future__ import annotations

import ctypes
import importlib.util
import os
import sys
from pathlib import Path
from typing import NoReturn


def _package() -> Path:
    found = importlib.util.find_spec("ovoid")
    if found is None or not found.submodule_search_locations:
        sys.exit("ovoid: the package is not installed")
    return Path(found.submodule_search_locations[0])


def _choose_driver(package: Path) -> None:
    spec = importlib.util.spec_from_file_location("_ovoid_drivers", package / "_drivers.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    module.choose()


def _choose_loader(package: Path) -> None:
    """The OpenCL loader of the package, where the system has none."""
    try:
        ctypes.CDLL("libOpenCL.so.1")
    except OSError:
        folders = [str(package / "loader"), os.environ.get("LD_LIBRARY_PATH", "")]
        os.environ["LD_LIBRARY_PATH"] = ":".join(filter(None, folders))


def main() -> NoReturn:
    package = _package()
    tool = package / "bin" / "ovoid"
    if not tool.exists():
        sys.exit(f"ovoid: there is no {tool}: this package was not built with the tool")
    _choose_driver(package)
    _choose_loader(package)
    os.execv(tool, ["ovoid", *sys.argv[1:]])


if __name__ == "__main__":
    main()
