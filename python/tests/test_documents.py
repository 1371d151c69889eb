"""What docs/python.md and the notebook say is done."""

import re
import shutil
from pathlib import Path

import ovoid
import pytest

pytestmark = pytest.mark.usefixtures("device")

REPOSITORY = Path(__file__).resolve().parents[2]


def test_guide(peptide_path, tmp_path, monkeypatch):
    text = (REPOSITORY / "docs" / "python.md").read_text("utf-8")
    blocks = re.findall(r"^```python\n(.*?)^```", text, re.M | re.S)
    assert len(blocks) > 4
    shutil.copy(peptide_path, tmp_path / "peptide.pdb")
    monkeypatch.chdir(tmp_path)
    names = {}
    for block in blocks:
        exec(compile(block, "docs/python.md", "exec"), names)
    assert names["measures"].deviation <= 0.5
    for made in ("peptide.ovoid", "peptide.ply", "difference.png", "peptide.cxc", "peptide.html"):
        assert (tmp_path / made).stat().st_size > 0
    for name in re.findall(r"`ovoid\.(\w+)", text):
        assert hasattr(ovoid, name) or name == "mdanalysis", name


def test_notebook(peptide_path):
    nbformat = pytest.importorskip("nbformat")
    preprocessors = pytest.importorskip("nbconvert.preprocessors")
    pytest.importorskip("ipykernel")
    notebook = nbformat.read(REPOSITORY / "python" / "examples" / "model.ipynb", 4)
    preprocessors.ExecutePreprocessor(timeout=300).preprocess(notebook)
    shown = [o.data for c in notebook.cells for o in c.get("outputs", ()) if "data" in o]
    assert "<iframe srcdoc=" in shown[1]["text/html"] and shown[1]["image/png"]
    assert shown[-1]["image/png"]
