"""Models are built when they are first used, in a task's thread: pydantic before 2.14 spoiled them for a second one."""

from __future__ import annotations

import sys
import threading
from collections.abc import Iterator
from typing import Annotated

import pytest
from pydantic import BaseModel, ConfigDict, Field, create_model


@pytest.fixture
def restless() -> Iterator[None]:
    """Threads that are changed as often as can be: with pydantic 2.13.5 two of three first uses fail."""
    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    yield
    sys.setswitchinterval(before)


class _Deferred(BaseModel):
    model_config = ConfigDict(extra="forbid", defer_build=True, validate_assignment=True)
    range: Annotated[float, Field(gt=0)] = 1.0


@pytest.mark.usefixtures("restless")
def test_threads_that_use_a_model_first_at_the_same_time_all_get_a_whole_one() -> None:
    failures: list[str] = []
    for _ in range(20):
        model = create_model("Model", __base__=_Deferred, beams=(int, 4))
        together = threading.Barrier(4)

        def use(model: type[BaseModel] = model, together: threading.Barrier = together) -> None:
            together.wait()
            try:
                made = model.model_validate({"beams": 3})
                made.range = 2.0  # type: ignore[attr-defined]
                made.model_dump()
            except Exception as error:
                failures.append(str(error))

        threads = [threading.Thread(target=use) for _ in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    assert failures == []
