"""Pictures with named channels."""

from __future__ import annotations

import numpy as np
import pytest

from sonar_component.samples import Frame


def test_a_frame_is_valid_with_and_without_named_channels() -> None:
    Frame().validate()
    Frame(1, np.zeros((2, 3, 3), np.float32), "strength,range,bearing").validate()


def test_a_picture_without_channels_is_refused() -> None:
    with pytest.raises(ValueError, match="must have 3 dimensions"):
        Frame(1, np.zeros((2, 3), np.uint8)).validate()


def test_each_channel_needs_one_name() -> None:
    with pytest.raises(ValueError, match="names 'a,b', but the image has 3"):
        Frame(1, np.zeros((2, 3, 3), np.uint8), "a,b").validate()
