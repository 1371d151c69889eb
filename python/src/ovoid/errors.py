"""What can go wrong: one base class, a subclass for each status of the library."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ._model import Model

__all__ = [
    "ArgumentError",
    "Cancelled",
    "DeviceError",
    "EmptyError",
    "FileError",
    "FormatError",
    "GoalWarning",
    "Interrupted",
    "LimitError",
    "MissingFileError",
    "NumericError",
    "OpenCLError",
    "OutOfMemoryError",
    "OvoidError",
    "OvoidWarning",
]


class OvoidError(Exception):
    """Base class of all errors of this package; the text is the library's own.

    Attributes
    ----------
    status : str
        Name of the library's status, such as ``"format"``.
    """

    status: str = "unknown"


class ArgumentError(OvoidError, ValueError):
    """An argument or option is out of its range."""

    status = "argument"


class OutOfMemoryError(OvoidError, MemoryError):
    """The host or the device is out of memory."""

    status = "memory"


class FileError(OvoidError, OSError):
    """A file cannot be opened, read or written."""

    status = "io"


class MissingFileError(FileError, FileNotFoundError):
    """There is no such file."""


class FormatError(OvoidError, ValueError):
    """A file's contents are not what its format asks for; the text names file, line and column."""

    status = "format"


class EmptyError(OvoidError, ValueError):
    """A molecule or model without any atom or ellipsoid that counts, or without a surface."""

    status = "empty"


class DeviceError(OvoidError, RuntimeError):
    """No OpenCL device, none that matches, or one that cannot be used."""

    status = "device"


class OpenCLError(OvoidError, RuntimeError):
    """An OpenCL call failed or a kernel did not build."""

    status = "opencl"


class Cancelled(OvoidError):
    """A progress callback or a time limit stopped the work.

    Attributes
    ----------
    model : Model or None
        Of a fit, the best model that held by then.
    """

    status = "cancelled"
    model: Model | None = None


class LimitError(OvoidError, OverflowError):
    """The job is larger than a limit of the library."""

    status = "limit"


class NumericError(OvoidError, ArithmeticError):
    """The computation produced a value that is not finite."""

    status = "numeric"


class Interrupted(KeyboardInterrupt):
    """Ctrl-C during a fit or another call: a KeyboardInterrupt that keeps what was found.

    Attributes
    ----------
    model : Model or None
        Of a fit, the best model that held by then.
    """

    model: Model | None = None


class OvoidWarning(UserWarning):
    """The library met something that does not stop the work."""


class GoalWarning(OvoidWarning):
    """A fit did not reach its goal: what it returns is the best model that it found."""


BY_STATUS: dict[int, type[OvoidError]] = {
    1: ArgumentError,
    2: OutOfMemoryError,
    3: FileError,
    4: FormatError,
    5: EmptyError,
    6: DeviceError,
    7: OpenCLError,
    8: Cancelled,
    9: LimitError,
    10: NumericError,
}
