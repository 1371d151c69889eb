"""Whether a device computes what it should."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass
from typing import Any

from . import _abi
from ._abi import CheckFunction, lib
from ._context import Context, Device, ProgressLike, default_context

VERDICTS = ("passed", "wrong", "failed")


@dataclass(frozen=True)
class Check:
    """One check of `SelfTest`.

    Attributes
    ----------
    name : str
    kernels : tuple of str
        The ones that it looks at.
    verdict : str
        ``"passed"``, ``"wrong"`` (a number is not what it should be) or ``"failed"`` (a call
        failed: nothing is known).
    seconds : float
        With compiling what was not compiled before.
    numbers : int
        That were compared.
    error : float
        The largest, as a share of what is allowed; NaN unless it passed.
    text : str
        What was wrong or failed, ``""`` of a check that passed.
    """

    name: str
    kernels: tuple[str, ...]
    verdict: str
    seconds: float
    numbers: int
    error: float
    text: str


@dataclass(frozen=True, repr=False)
class SelfTest:
    """What `selftest` found. ``print()`` shows a line for each check.

    Attributes
    ----------
    device : Device
    checks : tuple of Check
    launch_seconds : float
        To enqueue a kernel that does next to nothing, of many in a row; NaN, as those below, where
        a call failed.
    round_trip_seconds : float
        To launch one and read four bytes of what it wrote.
    to_device_bytes, from_device_bytes : float
        Per second, of 16 MiB in the program's memory.
    """

    device: Device
    checks: tuple[Check, ...]
    launch_seconds: float
    round_trip_seconds: float
    to_device_bytes: float
    from_device_bytes: float

    def _count(self, verdict: str) -> int:
        return sum(check.verdict == verdict for check in self.checks)

    @property
    def passed(self) -> bool:
        """Whether all checks did."""
        return self._count("passed") == len(self.checks)

    def __repr__(self) -> str:
        counts = ", ".join(f"{self._count(verdict)} {verdict}" for verdict in VERDICTS)
        return f"<ovoid.SelfTest of {self.device.name}: {counts}>"

    def __str__(self) -> str:
        lines = [f"{self.device.name} ({self.device.platform}, driver {self.device.driver})"]
        for check in self.checks:
            lines.append(
                f"{check.name:<14}  {check.verdict:<7}  {check.seconds:7.2f} s  "
                f"{check.numbers:8} numbers  {' '.join(check.kernels)}"
            )
            if check.text:
                lines.append(f"    {check.text}")
        lines.append(
            f"launch {1e6 * self.launch_seconds:.1f} µs, round trip "
            f"{1e6 * self.round_trip_seconds:.1f} µs, {1e-9 * self.to_device_bytes:.2f} GB/s to "
            f"the device, {1e-9 * self.from_device_bytes:.2f} GB/s from it"
        )
        return "\n".join(lines)


def _check(raw: Any) -> Check:
    def text(value: bytes | None) -> str:
        return (value or b"").decode("utf-8", "replace")

    return Check(
        name=text(raw.name),
        kernels=tuple(text(raw.kernels).split()),
        verdict=VERDICTS[raw.verdict],
        seconds=raw.seconds,
        numbers=raw.compared,
        error=raw.error,
        text=text(raw.text),
    )


def selftest(
    *,
    brief: bool = False,
    progress: ProgressLike = False,
    context: Context | None = None,
) -> SelfTest:
    """Tests every kernel on a device against plain C in double precision, on known inputs.

    A short form of it runs by itself when a device is first used with a driver; one that computes
    wrongly is refused with a `DeviceError`.

    Parameters
    ----------
    brief : bool
        The short form: small sizes, no pictures, no fit.
    progress : bool or callable
        See `Molecule.fit`.
    context : Context, optional
        The device to test; default: that of `use_device`.

    Returns
    -------
    SelfTest
        Also where checks found something wrong: see its ``passed``.
    """
    tested = context or default_context()
    checks: list[Check] = []

    def take(address: int, _user: int) -> None:
        checks.append(_check(_abi.Check.from_address(address)))

    options = _abi.filled(_abi.SelfTestOptions, brief=brief)
    result = _abi.filled(_abi.SelfTestResult)
    with tested._watching(progress):
        tested._call(
            lib.selftest,
            ctypes.byref(options),
            CheckFunction(take),
            None,
            ctypes.byref(result),
            needs_device=True,
        )
    return SelfTest(
        device=tested.device,
        checks=tuple(checks),
        launch_seconds=result.launch_seconds,
        round_trip_seconds=result.round_trip_seconds,
        to_device_bytes=result.to_device_bytes,
        from_device_bytes=result.from_device_bytes,
    )
