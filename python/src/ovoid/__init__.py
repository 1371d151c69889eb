"""Ovoid: the surface of a molecule by a few ellipsoids instead of thousands of atoms.

>>> import ovoid
>>> molecule = ovoid.read("1abc.cif.gz", assembly="1")       # doctest: +SKIP
>>> model = molecule.fit(tolerance=0.5)                      # doctest: +SKIP
>>> model.measure(molecule).hausdorff                        # doctest: +SKIP
>>> model.mesh().vertices                                    # doctest: +SKIP

Lengths are in Å, areas in Å², volumes in Å³, decays in Å⁻², angles in radian.
"""

from ._abi import lib as _lib
from ._context import Context, Device, Progress, devices, use_device
from ._field import Field
from ._fit import FitReport, Fitter
from ._measure import Measures, Pair
from ._mesh import Component, Distances, Mesh
from ._model import Model, read_model
from ._molecule import Assembly, Molecule, read
from ._objects import from_arrays, molecule
from ._picture import Image
from ._scene import Scene
from ._selftest import Check, SelfTest, selftest
from ._trajectory import FitTrajectory, SurfaceTrajectory, fit_trajectory, measure_trajectory
from .errors import (
    ArgumentError,
    Cancelled,
    DeviceError,
    EmptyError,
    FileError,
    FormatError,
    GoalWarning,
    Interrupted,
    LimitError,
    MissingFileError,
    NumericError,
    OpenCLError,
    OutOfMemoryError,
    OvoidError,
    OvoidWarning,
)

__version__: str = _lib.version().decode()

__all__ = [
    "ArgumentError",
    "Assembly",
    "Cancelled",
    "Check",
    "Component",
    "Context",
    "Device",
    "DeviceError",
    "Distances",
    "EmptyError",
    "Field",
    "FileError",
    "FitReport",
    "FitTrajectory",
    "Fitter",
    "FormatError",
    "GoalWarning",
    "Image",
    "Interrupted",
    "LimitError",
    "Measures",
    "Mesh",
    "MissingFileError",
    "Model",
    "Molecule",
    "NumericError",
    "OpenCLError",
    "OutOfMemoryError",
    "OvoidError",
    "OvoidWarning",
    "Pair",
    "Progress",
    "Scene",
    "SelfTest",
    "SurfaceTrajectory",
    "devices",
    "fit_trajectory",
    "from_arrays",
    "measure_trajectory",
    "molecule",
    "read",
    "read_model",
    "selftest",
    "use_device",
]
