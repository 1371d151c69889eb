#!/usr/bin/env python3
"""types.py FOLDER: mypy --strict on the package of this folder; 77 where there is no mypy."""

import importlib.util
import os
import subprocess
import sys

if importlib.util.find_spec("mypy") is None or importlib.util.find_spec("numpy") is None:
    print("skipped: no mypy (Debian: mypy) or no numpy")
    sys.exit(77)
os.environ.pop("PYTHONPATH", None)
command = [sys.executable, "-m", "mypy", "--cache-dir", os.path.join(os.getcwd(), "mypy")]
sys.exit(subprocess.run(command, cwd=sys.argv[1], check=False).returncode)
