"""What several tests share."""

import json
import os
import subprocess
from pathlib import Path

import ovoid
import pytest

PEPTIDE = Path("/usr/share/pymol/data/demo/pept.pdb")


@pytest.fixture(scope="session")
def device():
    if not ovoid.devices():
        pytest.skip("no OpenCL device")


@pytest.fixture(scope="session")
def peptide_path():
    if not PEPTIDE.exists():
        pytest.skip(f"no {PEPTIDE} (Debian: pymol-data)")
    return PEPTIDE


@pytest.fixture(scope="session")
def peptide(peptide_path):
    return ovoid.read(peptide_path)


@pytest.fixture(scope="session")
def model(peptide):
    return peptide.fit(ellipsoids=12)


@pytest.fixture(scope="session")
def tool():
    """Runs the tool and gives its report."""
    path = os.environ.get("OVOID_TOOL")
    if not path:
        pytest.skip("OVOID_TOOL names no tool")

    def run(folder, *arguments):
        report = folder / "report.json"
        command = [path, *map(str, arguments), "--quiet", "--report", str(report)]
        subprocess.run(command, check=True, timeout=120)
        return json.loads(report.read_text())

    return run
