"""Values of settings as people write them: ``120 deg`` where the model holds 2.094395 rad.

What is written here is understood again by `quantity.parse`, so it can be edited and sent back.
"""

from __future__ import annotations

from collections.abc import Iterator
from types import UnionType
from typing import Annotated, Any, Union, get_args, get_origin

from pydantic import BaseModel

from sonar_component.settings.quantity import UNITS, Dimension

# dimension -> units that people use, each from this size of the SI value on; the first also serves what is smaller
_USUAL: dict[str, tuple[tuple[str, float], ...]] = {
    "length": (("m", 0.0),),
    "angle": (("deg", 0.0),),
    "duration": (("us", 0.0), ("ms", 1e-3), ("s", 1.0)),
    "frequency": (("Hz", 0.0), ("kHz", 1e3)),
    "speed": (("m/s", 0.0),),
    "angular speed": (("deg/s", 0.0),),
    "temperature": (("degC", 0.0),),
    "attenuation": (("dB/m", 0.0),),
    "level": (("dB", 0.0),),
}
_DIGITS = 9  # [-], significant: a value that is sent back unchanged stays the same within 1e-9 of it


def written(model: type[BaseModel], name: str, value: Any) -> Any:
    """A field's value, its quantities as text with a unit, within lists and nested models too."""
    field = model.model_fields[name]
    return _written(value, field.annotation, field.metadata)


def _written(value: Any, annotation: Any, marks: Any = ()) -> Any:
    dimension = next((mark.name for mark in marks if isinstance(mark, Dimension)), "")
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        found = [dimension, *(_dimension(part) for part in _alternatives(annotation))]
        return quantity_text(value, next(filter(None, found), ""))
    if isinstance(value, dict):
        models = [part for part in _alternatives(annotation) if _is_model(part)]
        model = next((part for part in models if set(value) <= set(part.model_fields)), None)
        return {key: written(model, key, item) for key, item in value.items()} if model else value
    if isinstance(value, (list, tuple)):
        members = next((get_args(part) for part in _alternatives(annotation) if get_origin(part) in (list, tuple)), ())
        inner = [part for part in members if part is not ...]
        inner = inner * len(value) if len(inner) == 1 else inner
        return [_written(item, part) for item, part in zip(value, inner, strict=False)] if inner else value
    return value


def quantity_text(value: float, dimension: str) -> float | str:
    """``120 deg``: a value in SI with the unit that people use; without a unit, the number as it is."""
    if dimension not in _USUAL:
        return value
    usual = [unit for unit, least in _USUAL[dimension] if abs(value) >= least]
    unit = usual[-1] if value else _USUAL[dimension][-1][0]
    factor, offset = UNITS[dimension][unit]
    return f"{(value - offset) / factor:.{_DIGITS}g} {unit}"


def _alternatives(annotation: Any) -> Iterator[Any]:
    """The members of a union, or the annotation itself; marks of quantities are kept with them."""
    origin = get_origin(annotation)
    if origin is Annotated and not _dimension(annotation):
        yield from _alternatives(get_args(annotation)[0])
    elif origin in (Union, UnionType):
        for part in get_args(annotation):
            yield from _alternatives(part)
    else:
        yield annotation


def _dimension(annotation: Any) -> str:
    marks = get_args(annotation)[1:] if get_origin(annotation) is Annotated else ()
    return next((mark.name for mark in marks if isinstance(mark, Dimension)), "")


def _is_model(annotation: Any) -> bool:
    return isinstance(annotation, type) and issubclass(annotation, BaseModel)
