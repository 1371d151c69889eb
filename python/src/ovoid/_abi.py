"""The C interface: structures, functions, and the library that has them.

Nothing here calls OpenCL. The layouts below are those of include/ovoid/*.h; `load()` compares them
with what the library says of itself.
"""

from __future__ import annotations

import ctypes
import os
import sys
from ctypes import (
    CFUNCTYPE,
    POINTER,
    c_bool,
    c_char,
    c_char_p,
    c_double,
    c_float,
    c_int,
    c_int32,
    c_size_t,
    c_uint8,
    c_uint32,
    c_uint64,
    c_void_p,
)
from pathlib import Path
from typing import Any

ABI = 1
UNKNOWN = 2**64 - 1
NO_NUMBER = -(2**31)
COUNTS = 7
HERE = Path(__file__).resolve().parent


def _structure(name: str, *fields: tuple[str, Any]) -> Any:
    return type(name, (ctypes.Structure,), {"_fields_": list(fields)})


L1Progress = _structure(
    "ovoid_l1_progress",
    *((name, c_double) for name in ("accuracy_term", "sparse_term", "accuracy_weight")),
    *((name, c_double) for name in ("sparse_weight", "objective", "max_error", "step")),
)
AdaptiveProgress = _structure("ovoid_adaptive_progress", ("misfit", c_double))
Progress = _structure(
    "ovoid_progress",
    ("size", c_size_t),
    ("stage", c_char_p),
    ("done", c_uint64),
    ("total", c_uint64),
    ("seconds", c_double),
    ("method", c_int32),
    ("iteration", c_uint64),
    ("iterations", c_uint64),
    ("ellipsoids", c_uint64),
    ("points", c_uint64),
    ("l1", L1Progress),
    ("adaptive", AdaptiveProgress),
)
DeviceInfo = _structure(
    "ovoid_device_info",
    ("size", c_size_t),
    ("index", c_uint32),
    ("type", c_int),
    ("name", c_char * 128),
    ("vendor", c_char * 128),
    ("platform", c_char * 128),
    ("driver", c_char * 64),
    ("opencl", c_char * 64),
    ("compute_units", c_uint32),
    ("clock_mhz", c_uint32),
    ("float_width", c_uint32),
    ("fp64", c_bool),
    ("global_memory", c_uint64),
    ("max_allocation", c_uint64),
    ("local_memory", c_uint64),
    ("max_group", c_uint64),
    ("pci", c_char * 16),
    ("uuid", c_char * 40),
    ("platform_version", c_char * 64),
)
ReadOptions = _structure(
    "ovoid_read_options",
    ("size", c_size_t),
    ("format", c_int),
    ("radii", c_int),
    ("radii_file", c_char_p),
    ("select", c_char_p),
    ("model", c_int32),
    ("waters", c_bool),
    ("no_hydrogens", c_bool),
    ("assembly", c_char_p),
)
MOLECULE_COUNTS = (
    "lines",
    "atoms",
    "unit_atoms",
    "zero_radius",
    "hydrogens",
    "zero_occupancy",
    "guessed_radii",
    "models",
    "skipped",
    "skipped_models",
    "skipped_waters",
    "skipped_hydrogens",
    "skipped_selection",
    "skipped_assembly",
    "skipped_altlocs",
)
MoleculeCounts = _structure(
    "ovoid_molecule_counts",
    ("size", c_size_t),
    *((name, c_uint64) for name in MOLECULE_COUNTS),
)
AssemblyInfo = _structure(
    "ovoid_assembly_info", ("id", c_char * 16), ("placements", c_uint64), ("atoms", c_uint64)
)
L1Options = _structure(
    "ovoid_l1_options",
    ("kernel", c_int),
    ("iterations", c_uint32),
    ("sparse_iterations", c_uint32),
    ("inside_every", c_uint32),
    ("epsilon", c_double),
    ("max_error", c_double),
    ("prune_below", c_double),
    ("prune_every", c_uint32),
    ("first_step", c_int),
    ("armijo", c_double),
    ("shrink", c_double),
    ("grow", c_double),
    ("max_backtracks", c_uint32),
)
AdaptiveOptions = _structure(
    "ovoid_adaptive_options",
    ("goal", c_int),
    ("tolerance", c_double),
    ("ellipsoids", c_uint32),
    ("ratio", c_double),
    ("effort", c_uint32),
    ("steps", c_uint32),
    ("mesh_spacing", c_double),
)
PartsOptions = _structure(
    "ovoid_parts_options",
    *((name, c_uint32) for name in ("atoms", "jobs", "resume", "symmetry")),
    ("checkpoint", c_char_p),
    ("exchange", c_void_p),
)
FitOptions = _structure(
    "ovoid_fit_options",
    ("size", c_size_t),
    ("method", c_int),
    ("decay", c_double),
    ("isovalue", c_double),
    ("spacing", c_double),
    ("padding", c_double),
    ("adaptive", AdaptiveOptions),
    ("l1", L1Options),
    ("parts", PartsOptions),
)
L1Result = _structure(
    "ovoid_l1_result",
    *((name, c_double) for name in ("rms_error", "max_error", "lists_seconds")),
    *((name, c_double) for name in ("field_seconds", "moments_seconds", "host_seconds")),
    *((name, c_uint64) for name in ("list_builds", "field_passes", "moments_passes")),
)
AdaptiveResult = _structure("ovoid_adaptive_result", ("solver_iterations", c_uint64))
FitResult = _structure(
    "ovoid_fit_result",
    ("size", c_size_t),
    ("method", c_int),
    ("spacing", c_double),
    ("points", c_uint64),
    ("ellipsoids", c_uint64),
    ("iterations", c_uint64),
    ("reached", c_bool),
    ("verdict", c_int),
    ("distance", c_double),
    ("sample_seconds", c_double),
    ("fit_seconds", c_double),
    ("l1", L1Result),
    ("adaptive", AdaptiveResult),
    ("counts", c_uint64 * COUNTS),
    ("parts", c_uint64),
    ("units", c_uint64),
)
MeshOptions = _structure(
    "ovoid_mesh_options",
    ("size", c_size_t),
    ("isovalue", c_double),
    ("spacing", c_double),
    ("vertices", c_int),
    ("folder", c_char_p),
)
Component = _structure(
    "ovoid_component",
    ("vertices", c_uint64),
    ("triangles", c_uint64),
    ("area", c_double),
    ("volume", c_double),
    ("outer", c_bool),
    ("euler", c_int32),
    ("closed", c_bool),
)
Distances = _structure(
    "ovoid_distances",
    *((name, c_double) for name in ("hausdorff", "forward", "backward", "mean", "rms")),
)
Pair = _structure("ovoid_pair", *((name, c_double) for name in ("original", "sparse", "error")))
MeasureOptions = _structure(
    "ovoid_measure_options",
    ("size", c_size_t),
    ("isovalue", c_double),
    ("spacing", c_double),
    ("vertices", c_int),
    ("distances", c_bool),
    ("cell_atoms", c_uint32),
)
Measures = _structure(
    "ovoid_measures",
    ("size", c_size_t),
    *((name, Pair) for name in ("area", "volume", "area_outer", "volume_outer")),
    *((name, c_uint64) for name in ("components_original", "components_sparse")),
    *((name, c_uint64) for name in ("outer_original", "outer_sparse")),
    ("distances", Distances),
    ("distances_outer", Distances),
    *((name, c_double) for name in ("deviation", "seconds_mesh", "seconds_distances")),
    ("deviation_bound", c_double),
)
ExportOptions = _structure(
    "ovoid_export_options",
    ("size", c_size_t),
    ("format", c_int),
    ("isovalue", c_double),
    ("spacing", c_double),
    ("colour", c_double * 3),
    ("opacity", c_double),
    ("max_gigabytes", c_double),
    ("range", c_double),
    ("max_triangles", c_double),
    ("colouring", c_int),
)
Scene = _structure(
    "ovoid_scene",
    ("size", c_size_t),
    ("molecule", c_void_p),
    ("models", POINTER(c_void_p)),
    ("model_count", c_size_t),
    ("title", c_char_p),
    ("decay", c_double),
    ("isovalue", c_double),
)
PictureOptions = _structure(
    "ovoid_picture_options",
    ("size", c_size_t),
    ("view", c_int),
    ("width", c_uint32),
    ("height", c_uint32),
    ("samples", c_uint32),
    ("isovalue", c_double),
    ("direction", c_double * 3),
    ("rotation", c_double * 3),
    ("centre", c_double * 3),
    ("across", c_double),
    ("original", c_uint32),
    ("model", c_uint32),
    ("points", c_uint32),
    ("background", c_uint32),
    ("centres", c_bool),
    ("colour_bar", c_bool),
    ("range", c_double),
    ("colouring", c_int),
)

Check = _structure(
    "ovoid_check",
    ("size", c_size_t),
    ("name", c_char_p),
    ("kernels", c_char_p),
    ("verdict", c_int),
    ("seconds", c_double),
    ("compared", c_uint64),
    ("error", c_double),
    ("text", c_char_p),
)
SelfTestOptions = _structure("ovoid_selftest_options", ("size", c_size_t), ("brief", c_bool))
SelfTestResult = _structure(
    "ovoid_selftest_result",
    ("size", c_size_t),
    *((name, c_uint32) for name in ("passed", "wrong", "failed")),
    *((name, c_uint32) for name in ("vector", "lanes", "team", "solve_group")),
    *((name, c_double) for name in ("launch_seconds", "round_trip_seconds")),
    *((name, c_double) for name in ("to_device_bytes", "from_device_bytes")),
)

ProgressFunction = CFUNCTYPE(c_bool, c_void_p, c_void_p)
WarningFunction = CFUNCTYPE(None, c_char_p, c_void_p)
CheckFunction = CFUNCTYPE(None, c_void_p, c_void_p)

STRUCTURES = [
    *(L1Progress, AdaptiveProgress, Progress, DeviceInfo, ReadOptions, MoleculeCounts),
    *(AssemblyInfo, L1Options, AdaptiveOptions, PartsOptions, FitOptions),
    *(L1Result, AdaptiveResult, FitResult),
    *(MeshOptions, Component, Distances, Pair, MeasureOptions, Measures, ExportOptions),
    *(PictureOptions, Scene, Check, SelfTestOptions, SelfTestResult),
]

# Arrays of these are mapped by numpy, with these sizes in bytes.
ATOM = [("name", "S8"), ("element", "S3"), ("altloc", "S1"), ("serial", "<i4")]
ATOM += [("residue", "<u4"), ("flags", "<u4")]
RESIDUE = [("name", "S8"), ("chain", "S12"), ("number", "<i4"), ("insertion", "S1")]
RESIDUE += [("reserved", "V3"), ("first", "<u4")]
PLACEMENT: list[Any] = [("rotation", "<f8", (3, 3)), ("translation", "<f8", (3,))]
PLACEMENT += [("part", "<u4"), ("reserved", "<u4"), ("first", "<u8")]
MOTION: list[Any] = PLACEMENT[:2]
MAPPED = {"ovoid_atom": 24, "ovoid_residue": 32, "ovoid_placement": 112, "ovoid_ellipsoid": 80}
MAPPED["ovoid_motion"] = 96

_P = c_void_p
_DOUBLES = POINTER(c_double)
_SIZE = POINTER(c_size_t)

# Results and arguments. A result of "status" is an int, and its function takes the context first.
_FUNCTIONS: dict[str, tuple[Any, list[Any]]] = {
    "status_name": (c_char_p, [c_int]),
    "version": (c_char_p, []),
    "abi": (c_uint32, []),
    "sizeof": (c_size_t, [c_char_p]),
    "context_create": (c_int, [POINTER(_P)]),
    "context_destroy": (None, [POINTER(_P)]),
    "context_error": (c_char_p, [_P]),
    "context_on_warning": (None, [_P, WarningFunction, _P]),
    "context_on_progress": (None, [_P, ProgressFunction, _P]),
    "prepare_process": (None, []),
    "devices": (c_int, [_P, c_size_t, POINTER(_P), _SIZE]),
    "context_open_device": (c_int, [_P, c_char_p]),
    "context_device": (POINTER(DeviceInfo), [_P]),
    "context_device_count": (c_size_t, [_P]),
    "context_device_at": (POINTER(DeviceInfo), [_P, c_size_t]),
    "selftest": (
        c_int,
        [_P, POINTER(SelfTestOptions), CheckFunction, _P, POINTER(SelfTestResult)],
    ),
    "selftest_options_init": (None, [POINTER(SelfTestOptions), c_size_t]),
    "selftest_result_init": (None, [POINTER(SelfTestResult), c_size_t]),
    "free": (None, [_P]),
    "molecule_read_with": (c_int, [_P, c_char_p, POINTER(ReadOptions), POINTER(_P)]),
    "molecule_create": (c_int, [_P, _P, c_size_t, POINTER(_P)]),
    "molecule_create_known": (
        c_int,
        [_P, _P, _P, c_size_t, _P, c_size_t, c_int, c_char_p, POINTER(_P)],
    ),
    "molecule_destroy": (None, [POINTER(_P)]),
    "molecule_atoms": (c_size_t, [_P]),
    "molecule_xyzr": (_P, [_P]),
    "molecule_read_counts": (POINTER(MoleculeCounts), [_P]),
    "molecule_read_format": (c_int, [_P]),
    "molecule_radii": (c_int, [_P]),
    "radii_name": (c_char_p, [c_int]),
    "molecule_model": (c_int32, [_P]),
    "molecule_identity": (_P, [_P]),
    "molecule_residues": (_P, [_P, _SIZE]),
    "molecule_assemblies": (POINTER(AssemblyInfo), [_P, _SIZE]),
    "molecule_placements": (_P, [_P, _SIZE]),
    "molecule_part": (_P, [_P, c_uint32, _SIZE]),
    "molecule_unit_atoms": (c_size_t, [_P]),
    "molecule_expand": (c_int, [_P, _P]),
    "fit": (c_int, [_P, _P, POINTER(FitOptions), POINTER(_P), POINTER(FitResult)]),
    "fitter_create": (c_int, [_P, _P, POINTER(FitOptions), POINTER(_P)]),
    "fitter_destroy": (None, [POINTER(_P)]),
    "fitter_reach": (c_int, [_P, _P, POINTER(FitOptions), POINTER(_P), POINTER(FitResult)]),
    "fitter_start_from": (c_int, [_P, _P, _P]),
    "fitter_move": (c_int, [_P, _P, _P]),
    "model_create": (c_int, [_P, _P, c_size_t, c_double, c_double, POINTER(_P)]),
    "model_create_placed": (
        c_int,
        [_P, _P, c_size_t, _P, c_size_t, c_double, c_double, POINTER(_P)],
    ),
    "model_destroy": (None, [POINTER(_P)]),
    "model_size": (c_size_t, [_P]),
    "model_ellipsoids": (_P, [_P]),
    "model_placements": (_P, [_P, _SIZE]),
    "model_unit_size": (c_size_t, [_P]),
    "model_unit_ellipsoids": (_P, [_P]),
    "model_expand": (c_int, [_P, _P, POINTER(_P)]),
    "model_decay": (c_double, [_P]),
    "model_isovalue": (c_double, [_P]),
    "model_owner": (_P, [_P]),
    "model_owner_count": (c_size_t, [_P]),
    "model_note": (c_char_p, [_P, c_size_t]),
    "model_annotate": (c_int, [_P, _P, c_char_p, c_char_p]),
    "model_read": (c_int, [_P, c_char_p, POINTER(_P)]),
    "model_write": (c_int, [_P, _P, c_char_p]),
    "field_of_molecule": (c_int, [_P, _P, c_double, c_double, POINTER(_P)]),
    "field_of_model": (c_int, [_P, _P, POINTER(_P)]),
    "field_destroy": (None, [POINTER(_P)]),
    "field_terms": (c_size_t, [_P]),
    "field_decay": (c_double, [_P]),
    "field_isovalue": (c_double, [_P]),
    "field_evaluate": (c_int, [_P, _P, _P, c_size_t, _P, _P]),
    "field_mesh": (c_int, [_P, _P, POINTER(MeshOptions), POINTER(_P)]),
    "field_export": (c_int, [_P, _P, c_char_p, POINTER(ExportOptions)]),
    "mesh_create": (c_int, [_P, _P, _P, c_size_t, _P, c_size_t, POINTER(_P)]),
    "mesh_destroy": (None, [POINTER(_P)]),
    "mesh_vertices": (c_size_t, [_P]),
    "mesh_triangles": (c_size_t, [_P]),
    "mesh_xyz": (_P, [_P]),
    "mesh_normals": (_P, [_P]),
    "mesh_corners": (_P, [_P]),
    "mesh_component_of": (_P, [_P]),
    "mesh_components": (c_size_t, [_P]),
    "mesh_component": (POINTER(Component), [_P, c_size_t]),
    "mesh_area": (c_double, [_P]),
    "mesh_volume": (c_double, [_P]),
    "mesh_smooth_area": (c_double, [_P]),
    "mesh_smooth_volume": (c_double, [_P]),
    "mesh_write": (c_int, [_P, _P, c_char_p]),
    "mesh_distances": (c_int, [_P, _P, _P, c_bool, POINTER(Distances), POINTER(c_float)]),
    "measure": (c_int, [_P, _P, _P, POINTER(MeasureOptions), POINTER(Measures)]),
    "scene_init": (None, [POINTER(Scene), c_size_t]),
    "scene_export": (c_int, [_P, POINTER(Scene), c_char_p, POINTER(ExportOptions)]),
    "export_format_name": (c_char_p, [c_int]),
    "export_format_find": (c_int, [c_char_p]),
    "export_options_init": (None, [POINTER(ExportOptions), c_size_t]),
    "measures_init": (None, [POINTER(Measures), c_size_t]),
    "picture_options_init": (None, [POINTER(PictureOptions), c_size_t]),
    "read_options_init": (None, [POINTER(ReadOptions), c_size_t]),
    "fit_options_init": (None, [POINTER(FitOptions), c_size_t]),
    "fit_result_init": (None, [POINTER(FitResult), c_size_t]),
    "mesh_options_init": (None, [POINTER(MeshOptions), c_size_t]),
    "measure_options_init": (None, [POINTER(MeasureOptions), c_size_t]),
    "render": (c_int, [_P, _P, _P, POINTER(PictureOptions), POINTER(_P)]),
    "image_destroy": (None, [POINTER(_P)]),
    "image_width": (c_uint32, [_P]),
    "image_height": (c_uint32, [_P]),
    "image_pixels": (POINTER(c_uint8), [_P]),
    "image_range": (c_double, [_P]),
    "image_write": (c_int, [_P, _P, c_char_p]),
}


def _loader() -> None:
    """Makes libOpenCL.so.1 known before the library asks for it: the system's, or the one here."""
    if sys.platform == "darwin":
        return
    try:
        ctypes.CDLL("libOpenCL.so.1")
        return
    except OSError:
        bundled = HERE / "loader" / "libOpenCL.so.1"
    if bundled.exists():
        ctypes.CDLL(str(bundled), mode=ctypes.RTLD_GLOBAL)


def library_path() -> str:
    """Where the library is: OVOID_LIBRARY, else in this package, else where the system has it."""
    chosen = os.environ.get("OVOID_LIBRARY")
    if chosen:
        return chosen
    for pattern in ("libovoid.so.?", "libovoid.?.dylib"):
        for found in sorted((HERE / "lib").glob(pattern)):
            return str(found)
    return "libovoid.1.dylib" if sys.platform == "darwin" else f"libovoid.so.{ABI}"


def _open() -> ctypes.CDLL:
    path = library_path()
    _loader()
    try:
        return ctypes.CDLL(path)
    except OSError as error:
        if "OpenCL" in str(error):
            raise ImportError(
                "ovoid: there is no OpenCL loader, libOpenCL.so.1. Install one: apt-get install "
                "ocl-icd-libopencl1 (Debian, Ubuntu), dnf install ocl-icd (Fedora)"
            ) from error
        raise ImportError(f"ovoid: the library cannot be loaded: {error}") from error


def check(library: ctypes.CDLL) -> None:
    """The library has this interface, and lays structures out as is done here; else ImportError."""
    library.ovoid_abi.restype = c_uint32
    found = library.ovoid_abi()
    if found != ABI:
        raise ImportError(
            f"ovoid: {library._name} has version {found} of the C interface, and this package "
            f"needs version {ABI}"
        )
    library.ovoid_sizeof.restype = c_size_t
    library.ovoid_sizeof.argtypes = [c_char_p]
    sizes = {s.__name__: ctypes.sizeof(s) for s in STRUCTURES}
    for name, size in {**sizes, **MAPPED}.items():
        theirs = library.ovoid_sizeof(name.encode())
        first = next((s._fields_[0][0] for s in STRUCTURES if s.__name__ == name), "")
        # Structures that begin with their size may have grown: the library takes shorter ones.
        if theirs < size or (theirs != size and first != "size"):
            raise ImportError(
                f"ovoid: {name} has {theirs} bytes in {library._name}, and {size} in this package"
            )


class Library:
    """The functions, without their prefix: ``lib.model_size(handle)``."""

    def __init__(self) -> None:
        self.cdll = _open()
        try:
            check(self.cdll)
            for name, (result, arguments) in _FUNCTIONS.items():
                function = getattr(self.cdll, "ovoid_" + name)
                function.restype = result
                function.argtypes = arguments
                setattr(self, name, function)
        except AttributeError as error:
            raise ImportError(f"ovoid: {self.cdll._name} is another version: {error}") from error

    def __getattr__(self, name: str) -> Any:  # for type checkers: all are set above
        raise AttributeError(name)


lib = Library()


def filled(structure: Any, **values: Any) -> Any:
    """A structure of the library's defaults and these values; None leaves the default."""
    made = structure()
    init = getattr(lib, structure.__name__[len("ovoid_") :] + "_init")
    init(ctypes.byref(made), ctypes.sizeof(made))
    for name, value in values.items():
        if value is not None:
            setattr(made, name, value)
    return made
