"""The device and what is at work on it: contexts, errors, warnings, progress, Ctrl-C."""

from __future__ import annotations

import collections
import ctypes
import os
import signal
import sys
import threading
import time
import warnings
import weakref
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from types import FrameType
from typing import Any, Union

from . import _drivers
from ._abi import UNKNOWN, DeviceInfo, ProgressFunction, WarningFunction, lib
from ._abi import Progress as _Progress
from .errors import (
    BY_STATUS,
    ArgumentError,
    DeviceError,
    FileError,
    Interrupted,
    MissingFileError,
    OvoidError,
    OvoidWarning,
)

_DEVICE_TYPES = ("cpu", "gpu", "accelerator", "other")


@dataclass(frozen=True)
class Device:
    """An OpenCL device.

    Attributes
    ----------
    index : int
        Its place in the list of all devices, from 0.
    type : str
        ``"cpu"``, ``"gpu"``, ``"accelerator"`` or ``"other"``.
    name, vendor, platform, driver, opencl : str
        As the driver tells them; `driver` and `opencl` are versions.
    compute_units, clock_mhz : int
    global_memory, max_allocation : int
        Bytes of all its memory, and of one buffer at most.
    pci, uuid : str
        Where it is on the PCI bus, and its own number; ``""`` where the driver does not tell.
    """

    index: int
    type: str
    name: str
    vendor: str
    platform: str
    driver: str
    opencl: str
    compute_units: int
    clock_mhz: int
    global_memory: int
    max_allocation: int
    pci: str
    uuid: str


@dataclass(frozen=True)
class Progress:
    """What a call that takes long is doing.

    Attributes
    ----------
    stage : str
        One word, such as ``"sample"``, ``"refine"`` or ``"mesh"``.
    done, total : int or None
        Of this stage, in parts of its own.
    seconds : float
        Since the call began.
    ellipsoids : int or None
        Of a fit, how many there are now.
    """

    stage: str
    done: int
    total: int | None
    seconds: float
    ellipsoids: int | None


#: What functions take as ``progress=``: True shows a bar of tqdm, a function is called some times
#: a second with a `Progress` and stops the work by returning False.
ProgressLike = Union[bool, Callable[[Progress], Any], None]

_PERIOD = 0.1  # seconds between two calls of the user's function


def _device(info: Any) -> Device:
    def text(raw: bytes) -> str:
        return raw.decode("utf-8", "replace").strip()

    kind = _DEVICE_TYPES[info.type] if 0 <= info.type < len(_DEVICE_TYPES) else "other"
    return Device(
        index=info.index,
        type=kind,
        name=text(info.name),
        vendor=text(info.vendor),
        platform=text(info.platform),
        driver=text(info.driver),
        opencl=text(info.opencl),
        compute_units=info.compute_units,
        clock_mhz=info.clock_mhz,
        global_memory=info.global_memory,
        max_allocation=info.max_allocation,
        pci=text(info.pci),
        uuid=text(info.uuid),
    )


def _progress(address: int) -> Progress:
    told = _Progress.from_address(address)
    return Progress(
        stage=(told.stage or b"").decode(),
        done=told.done,
        total=None if told.total == UNKNOWN else told.total,
        seconds=told.seconds,
        ellipsoids=told.ellipsoids if told.method >= 0 and told.ellipsoids != UNKNOWN else None,
    )


class _Watch:
    """What a call's progress goes to: the user's function, a bar, and a limit of time."""

    def __init__(self, wanted: ProgressLike, time_limit: float | None) -> None:
        self.function: Callable[[Progress], Any] | None = None
        self.bar: _Bar | None = None
        self.out_of_time = False
        self.asked = False  # to stop
        self.end = None if time_limit is None else time.monotonic() + time_limit
        self.next = 0.0
        if callable(wanted):
            self.function = wanted
        elif wanted:
            self.bar = _Bar.make()
            self.function = self.bar

    def __call__(self, address: int) -> bool:
        now = time.monotonic()
        if self.end is not None and now >= self.end:
            self.out_of_time = self.asked = True
        elif self.function is not None and now >= self.next:
            self.next = now + _PERIOD
            self.asked = self.function(_progress(address)) is False
        return not self.asked

    def close(self) -> None:
        if self.bar is not None:
            self.bar.close()


class _Bar:
    """A line of tqdm: stages have parts of their own, so it counts seconds, not a percentage."""

    def __init__(self, tqdm: Any) -> None:
        self.tqdm = tqdm(
            total=None, bar_format="{desc} [{elapsed}]", desc="ovoid", leave=False, mininterval=0
        )

    @staticmethod
    def make() -> _Bar | None:
        try:
            from tqdm.auto import tqdm
        except ImportError:
            warnings.warn("progress=True needs tqdm: pip install tqdm", OvoidWarning, stacklevel=6)
            return None
        return _Bar(tqdm)

    def __call__(self, told: Progress) -> bool:
        share = f" {100 * told.done // told.total} %" if told.total else ""
        count = f", {told.ellipsoids} ellipsoids" if told.ellipsoids else ""
        self.tqdm.set_description_str(f"ovoid: {told.stage}{share}{count}", refresh=True)
        return True

    def close(self) -> None:
        self.tqdm.close()


class Context:
    """A device with its compiled programs. Most programs need none but the default one.

    A context works for one thread at a time: calls from others wait. Contexts are independent, so
    that threads with one each work side by side.

    Parameters
    ----------
    device : str, optional
        An index (``"0"``), a type (``"cpu"``, ``"gpu"``, ``"accelerator"``), an address on the PCI
        bus, a UUID, or a part of a device's or platform's name. Default: the environment variable
        OVOID_DEVICE, else the first GPU, else the first device. It is opened when first needed.
        Of several, as ``"0,1"``, ``"gpus"`` or ``"all"``, the parts of a large molecule are fitted
        on each, and all else is done on the first.

    Notes
    -----
    No OpenCL driver survives a fork: in a process that was forked after a device was used, what
    needs a device raises `DeviceError`. Start processes with the method ``"spawn"`` or
    ``"forkserver"`` of `multiprocessing`, or fork before the first use.
    """

    def __init__(self, device: str | int | None = None) -> None:
        self._selector = None if device is None else str(device)
        self._handle = ctypes.c_void_p()
        self._lock = threading.RLock()
        self._running = False
        self._opened = False
        self._watch: _Watch | None = None
        self._raised: BaseException | None = None
        self._warned: list[str] = []
        # Fields and fitters that are no longer used. They are destroyed when nothing is at work,
        # for garbage is collected at any moment, in a progress callback too.
        self._graves: collections.deque[tuple[Any, Any]] = collections.deque()
        self._on_progress = ProgressFunction(self._told_progress)
        self._on_warning = WarningFunction(self._told_warning)
        _contexts.add(self)

    def __repr__(self) -> str:
        opened = lib.context_device(self._handle) if self._opened else None
        name = _device(opened.contents).name if opened else self._selector or "default"
        return f"<ovoid.Context on {name}{'' if opened else ', not opened yet'}>"

    @property
    def device(self) -> Device:
        """The device, opened now if it was not."""
        with self._lock:
            self._open_device()
            return _device(lib.context_device(self._handle).contents)

    @property
    def used_devices(self) -> list[Device]:
        """The devices that were chosen, `device` first; one that failed in a fit is left out."""
        with self._lock:
            self._open_device()
            count = lib.context_device_count(self._handle)
            return [
                _device(lib.context_device_at(self._handle, n).contents) for n in range(count)
            ]

    def devices(self) -> list[Device]:
        """All devices of all OpenCL platforms."""
        found = ctypes.c_void_p()
        count = ctypes.c_size_t()
        with self._lock:
            self._prepare()
            self._call(
                lib.devices, ctypes.sizeof(DeviceInfo), ctypes.byref(found), ctypes.byref(count)
            )
            entries = (DeviceInfo * count.value).from_address(found.value) if found.value else ()
            result = [_device(entry) for entry in entries]
            lib.free(found)
        return result

    # ---- calls ----

    def _told_progress(self, address: int, _user: int) -> bool:
        try:
            if self._raised is None and self._watch is not None:
                return self._watch(address)
        except BaseException as error:
            self._raised = error
        return self._raised is None

    def _told_warning(self, text: bytes, _user: int) -> None:
        self._warned.append(text.decode("utf-8", "replace"))

    def _call(self, function: Any, *arguments: Any, needs_device: bool = False) -> None:
        """Calls a function that returns a status with this context first, and raises its error."""
        with self._lock:
            if self._running:
                raise ArgumentError("a progress callback cannot use the context that called it")
            if not self._handle:
                self._create()
            if needs_device:
                self._open_device()
            self._bury()
            self._raised = None
            self._running = True
            try:
                with self._signals():
                    status = function(self._handle, *arguments)
            finally:
                self._running = False
            self._warn()
            if status or self._raised is not None:
                self._fail(status)

    @contextmanager
    def _signals(self) -> Iterator[None]:
        """What the handler of Ctrl-C raises meanwhile stops the call, and is raised after it: it
        would be lost where it met the library in between."""
        before = signal.getsignal(signal.SIGINT)
        if not callable(before) or threading.current_thread() is not threading.main_thread():
            yield
            return

        def handle(number: int, frame: FrameType | None) -> None:
            try:
                before(number, frame)
            except BaseException as error:
                self._raised = error

        signal.signal(signal.SIGINT, handle)
        try:
            yield
        finally:
            signal.signal(signal.SIGINT, before)

    def _create(self) -> None:
        if lib.context_create(ctypes.byref(self._handle)):
            raise MemoryError("ovoid: no memory for a context")
        lib.context_on_progress(self._handle, self._on_progress, None)
        lib.context_on_warning(self._handle, self._on_warning, None)
        address = self._handle.value
        assert address is not None
        weakref.finalize(self, _destroy, lib.context_destroy, address).atexit = False

    def _prepare(self) -> None:
        _drivers.prepare()

    def _open_device(self) -> None:
        if self._opened:
            return
        self._prepare()
        selector = None if self._selector is None else self._selector.encode()
        try:
            self._call(lib.context_open_device, selector)
        except DeviceError as error:
            hint = _drivers.hint()
            if "no OpenCL device found" in str(error) and hint:
                raise DeviceError(f"{error}\n{hint}") from None
            raise
        self._opened = True

    def _select(self, device: str | int | None) -> None:
        with self._lock:
            before = self._selector, self._opened
            self._selector, self._opened = None if device is None else str(device), False
            try:
                self._open_device()
            except BaseException:
                self._selector, self._opened = before
                raise

    def _warn(self) -> None:
        warned, self._warned = self._warned, []
        for text in warned:
            warnings.warn(text, OvoidWarning, stacklevel=_outside())

    def _fail(self, status: int) -> None:
        raised, self._raised = self._raised, None
        if isinstance(raised, KeyboardInterrupt):
            raise Interrupted(*raised.args) from None
        if raised is not None:
            raise raised
        text = lib.context_error(self._handle).decode("utf-8", "replace")
        raise BY_STATUS.get(status, OvoidError)(text)

    def _discard(self, destroy: Any, address: int) -> None:
        self._graves.append((destroy, address))
        if self._lock.acquire(blocking=False):
            try:
                if not self._running:
                    self._bury()
            finally:
                self._lock.release()

    def _bury(self) -> None:
        while self._graves:
            destroy, address = self._graves.popleft()
            destroy(ctypes.byref(ctypes.c_void_p(address)))

    @contextmanager
    def _watching(
        self, progress: ProgressLike, time_limit: float | None = None
    ) -> Iterator[_Watch]:
        """Tells of the calls within, and stops them when the function or the limit says so."""
        with self._lock:
            before = self._watch
            self._watch = watch = _Watch(progress, time_limit)
            try:
                yield watch
            finally:
                self._watch = before
                watch.close()


def _outside() -> int:
    """How far up the first caller outside this package is, for warnings."""
    here = os.path.dirname(os.path.abspath(__file__))
    level, frame = 1, sys._getframe(1)
    while frame.f_back is not None and os.path.dirname(frame.f_code.co_filename) == here:
        frame = frame.f_back
        level += 1
    return level


_contexts: weakref.WeakSet[Context] = weakref.WeakSet()
_default: Context | None = None
_default_lock = threading.Lock()
_local = threading.local()


def default_context() -> Context:
    """The context that is used where none is given, made when first asked for."""
    global _default
    with _default_lock:
        if _default is None:
            _default = Context()
        return _default


def host_context() -> Context:
    """A context of this thread for what needs no device, so that it waits for no other thread."""
    context: Context | None = getattr(_local, "context", None)
    if context is None:
        _local.context = context = Context()
    return context


def use_device(device: str | int | None) -> Device:
    """Opens a device, or several, for all that follows.

    Parameters
    ----------
    device : str, int or None
        As `Context` takes it; None is the default one.

    Returns
    -------
    Device
        The first of them.
    """
    context = default_context()
    context._select(device)
    return context.device


def devices() -> list[Device]:
    """All devices of all OpenCL platforms.

    Returns
    -------
    list of Device
        Empty where there is none.
    """
    return default_context().devices()


def _after_fork() -> None:
    """Another thread of the parent may have held the locks."""
    global _default_lock
    _default_lock = threading.Lock()
    for context in list(_contexts):
        context._lock = threading.RLock()
        context._running = False
        context._watch = None


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_after_fork)


class Handle:
    """An object of the library, which is destroyed with this one."""

    def __init__(self, address: int, destroy: Any, context: Context | None = None) -> None:
        self.pointer = ctypes.c_void_p(address)
        if context is None:
            finalizer = weakref.finalize(self, _destroy, destroy, address)
        else:
            finalizer = weakref.finalize(self, context._discard, destroy, address)
        finalizer.atexit = False


def _destroy(destroy: Any, address: int) -> None:
    destroy(ctypes.byref(ctypes.c_void_p(address)))


def encode(path: str | os.PathLike[str], name: str = "path") -> bytes:
    """A path as the library takes it."""
    raw = os.fsencode(path)
    if b"\0" in raw:
        raise ArgumentError(f"{name} holds a null character")
    return raw


def is_missing(error: FileError, path: bytes) -> FileError:
    """The same as MissingFileError where there is no such file."""
    if path != b"-" and not os.path.lexists(path):
        return MissingFileError(str(error))
    return error
