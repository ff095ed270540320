from __future__ import annotations

from typing import Annotated, ClassVar, Literal

import pytest
from pydantic import BaseModel, Field

from sonar_component.middleware.deployment.task_types import task_type, task_type_names
from sonar_component.middleware.introspection import properties_of
from sonar_component.settings.meaning import meaning
from sonar_component.settings.quantity import Angle, Length


class _Base(BaseModel):
    limits: ClassVar = {"far": ("length", 1.0, 9.0)}
    near: Annotated[Length, Field(ge=0, le=2)] = Field(default=1.0, description="where it begins")
    far: Length = Field(default=2.0, description="where it ends; later than near")
    wide: Annotated[Angle, Field(gt=0)] = Field(default=1.0, description="opening")
    loss: Annotated[float, Field(ge=0, lt=5)] = Field(default=1.0, description="of sound [dB]")
    kind: Literal["flat", "round"] | None = Field(default=None, description="shape")
    name: str = Field(default="", description="of the thing")
    bare: Annotated[int, Field(le=3)] = 1


class _Derived(_Base):
    near: Length = 3.0


@pytest.mark.parametrize(
    ("model", "name", "line"),
    [
        (_Base, "near", "where it begins [m]; 0 m to 2 m"),
        (_Base, "far", "where it ends [m]; later than near; 1 m to 9 m"),
        (_Base, "wide", "opening [rad]; above 0 deg"),
        (_Base, "loss", "of sound [dB]; at least 0, below 5"),
        (_Base, "kind", "shape; flat or round"),
        (_Base, "name", "of the thing"),
        (_Base, "bare", "at most 3"),
        (_Derived, "near", "where it begins [m]"),
    ],
)
def test_a_setting_is_told_with_its_unit_and_its_limits(model: type[BaseModel], name: str, line: str) -> None:
    assert meaning(model, name) == line


@pytest.mark.parametrize("name", task_type_names())
def test_no_property_of_a_task_is_without_a_meaning(name: str) -> None:
    docs = {key: item["doc"] for key, item in properties_of(task_type(name)("task")).items()}
    assert [key for key, doc in docs.items() if not doc] == []
    assert [key for key, doc in docs.items() if "\n" in doc or len(doc) > 160] == []  # one line of a terminal or two
