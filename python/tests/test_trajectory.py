"""Frame after frame."""

import numpy as np
import ovoid
import pytest

pytestmark = pytest.mark.usefixtures("device")


def frames(peptide, count):
    """The molecule turns and breathes a little."""
    xyz = np.array(peptide.xyz)
    middle = xyz.mean(axis=0)
    made = []
    for k in range(count):
        a = 0.05 * k
        turn = np.array([[np.cos(a), -np.sin(a), 0], [np.sin(a), np.cos(a), 0], [0, 0, 1]])
        made.append((xyz - middle) @ turn.T * (1 + 0.004 * k) + middle)
    return np.array(made)


def test_surfaces(peptide):
    places = frames(peptide, 3)
    found = ovoid.measure_trajectory(places, peptide, spacing=0.7)
    for k in range(3):
        mesh = ovoid.Molecule(places[k], peptide.radii).mesh(0.7)
        assert (found.area[k], found.volume[k]) == (mesh.area, mesh.volume)
    assert found.frame.tolist() == [0, 1, 2] and len(found) == 3
    part = ovoid.measure_trajectory(places, radii=peptide.radii, spacing=0.7, start=2)
    assert part.frame.tolist() == [2] and part.area[0] == found.area[2]


def test_fits(peptide):
    places = frames(peptide, 5)
    found = ovoid.fit_trajectory(places, peptide, ellipsoids=10, fresh_every=3)
    assert found.ellipsoids.tolist() == [10] * 5 and found.reached.all()
    assert np.isnan(found.fresh_deviation).tolist() == [False, True, True, False, True]
    # An ellipsoid keeps its atoms from frame to frame, and stays as near as a fresh fit is.
    for before, after in zip(found.models, found.models[1:]):
        assert np.array_equal(before.owner, after.owner)
        assert np.abs(before.centres - after.centres).max() < 1.5
    assert found.deviation[3] < 1.5 * found.fresh_deviation[3]
    last = found.models[4].measure(ovoid.Molecule(places[4], peptide.radii))
    assert found.model_area[4] == last.area.model
    assert found.deviation[4] == pytest.approx(last.deviation, abs=1e-5)


@pytest.mark.parametrize(
    ("text", "call"),
    [
        ("need radii=", lambda m: ovoid.fit_trajectory(np.zeros((2, 5, 3)))),
        ("frames, atoms, 3", lambda m: ovoid.fit_trajectory(np.zeros((5, 3)), m)),
        ("no frame", lambda m: ovoid.measure_trajectory(np.zeros((0, 5, 3)), m)),
        ("a frame 5", lambda m: ovoid.measure_trajectory(np.zeros((2, 5, 3)), m)),
    ],
)
def test_errors(peptide, text, call):
    with pytest.raises(ovoid.ArgumentError, match=text):
        call(peptide)


def test_mdanalysis(peptide, peptide_path):
    mda = pytest.importorskip("MDAnalysis")
    from ovoid.mdanalysis import FitAnalysis, SurfaceAnalysis

    universe = mda.Universe(str(peptide_path))
    universe.load_new(frames(peptide, 3).astype(np.float32))
    found = SurfaceAnalysis(universe.atoms, spacing=0.7).run()
    whole = ovoid.measure_trajectory(universe, spacing=0.7)
    assert np.array_equal(found.results.area, whole.area)
    fits = FitAnalysis(universe.atoms, ellipsoids=8, measure=False).run(stop=2)
    assert fits.results.ellipsoids.tolist() == [8, 8] and len(fits.results.models) == 2
    assert np.isnan(fits.results.area).all()


def test_dataframe(peptide):
    pytest.importorskip("pandas")
    found = ovoid.measure_trajectory(frames(peptide, 2), peptide, spacing=1.0)
    table = found.to_dataframe()
    assert table.index.name == "frame" and np.array_equal(table["area"], found.area)
