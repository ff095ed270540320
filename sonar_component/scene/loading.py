"""One door for every kind of scene: scene YAML, SDF, or a bare mesh file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from sonar_component.scene.body import Body
from sonar_component.scene.mesh_file import SUFFIXES, read_mesh_file
from sonar_component.scene.scene_file import read_scene_file
from sonar_component.scene.sdf.world import read_sdf
from sonar_component.scene.world import World
from sonar_component.settings import SettingsError, find_file

_YAML = (".yaml", ".yml")
_SDF = (".sdf", ".world")


def load_world(path: str | Path, search_path: Sequence[str | Path] = ()) -> World:
    """Read a scene YAML, an SDF world, model or model folder, or a bare mesh file (metres, Z up).

    Parameters
    ----------
    path : looked for as written, beside the working directory and among the files that come with the package.
    search_path : folders for model:// references of SDF, before those of SDF_PATH and GZ_SIM_RESOURCE_PATH.

    Raises
    ------
    SettingsError
        When the file is missing, of an unknown kind, or wrong; says where, what is allowed and what was got.
    """
    found = find_file(path)
    suffix = found.suffix.lower()
    if suffix in _YAML:
        return read_scene_file(found, search_path)
    if suffix in _SDF or found.is_dir():
        return read_sdf(found, search_path)
    if suffix in SUFFIXES:
        parts, warnings = read_mesh_file(found)
        return World([Body(found.stem, parts, np.eye(4))], warnings)
    allowed = ", ".join((*_YAML, *_SDF, *SUFFIXES))
    raise SettingsError(f"is not a scene known here; allowed: {allowed}", str(found))
