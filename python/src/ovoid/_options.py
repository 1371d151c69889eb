"""What fits can be asked for: the options that fits of all kinds share, written down once."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Mapping
from typing import Any, TypedDict, TypeVar, cast

from ._context import ProgressLike

F = TypeVar("F", bound=Callable[..., Any])


class SurfaceOptions(TypedDict, total=False):
    """The surface that is fitted: what a `Fitter` holds to."""

    decay: float | None
    isovalue: float | None
    spacing: float | None
    padding: float | None
    mesh_spacing: float | None


class SearchOptions(TypedDict, total=False):
    """How a model is looked for, apart from its goal."""

    method: str
    effort: int | None
    steps: int | None
    l1: Mapping[str, Any] | None
    part_atoms: int | None
    jobs: int | None
    time_limit: float | None
    progress: ProgressLike


class FitOptions(SurfaceOptions, SearchOptions, total=False):
    """Both."""


#: Where an option is not None when left out.
_DEFAULTS: dict[str, Any] = {"method": "adaptive", "progress": False}


def spelled_out(options: type) -> Callable[[F], F]:
    """Of a function that takes ``**options``: makes help() and notebooks show them by name, and
    refuses others as Python does."""
    taken = [
        inspect.Parameter(
            name,
            inspect.Parameter.KEYWORD_ONLY,
            default=_DEFAULTS.get(name),
            annotation=getattr(annotation, "__forward_arg__", annotation),
        )
        for name, annotation in options.__annotations__.items()
    ]

    def decorate(function: F) -> F:
        signature = inspect.signature(function)
        own = [p for p in signature.parameters.values() if p.kind is not p.VAR_KEYWORD]
        shown = signature.replace(parameters=[*own, *taken])

        @functools.wraps(function)
        def checked(*arguments: Any, **named: Any) -> Any:
            for name in named:
                if name not in shown.parameters:
                    text = f"{function.__name__}() got an unexpected keyword argument {name!r}"
                    raise TypeError(text)
            return function(*arguments, **named)

        checked.__signature__ = shown  # type: ignore[attr-defined]
        return cast(F, checked)

    return decorate


def part(options: Mapping[str, Any], kind: type) -> Any:
    """Those of the options that are of a kind."""
    return {name: value for name, value in options.items() if name in kind.__annotations__}
