"""Worlds, models, includes and links to a World.

A top-level model becomes a body, called as the model; models inside it are parts of it. Joints stay where they are
drawn. Whatever cannot be read is left out with a warning that names file, line and reason; the rest of the world
stands.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from sonar_component.scene import pose
from sonar_component.scene.body import Body, Part
from sonar_component.scene.sdf.frames import Scope, relative_name
from sonar_component.scene.sdf.geometry import Geometries
from sonar_component.scene.sdf.known import Unread
from sonar_component.scene.sdf.material import Materials, reflectance_of
from sonar_component.scene.sdf.model_folder import model_file
from sonar_component.scene.sdf.numbers import read_pose, truth
from sonar_component.scene.sdf.uri import SearchPath
from sonar_component.scene.sdf.xml import Element, read_xml
from sonar_component.scene.world import World
from sonar_component.settings import SettingsError

MAX_INCLUDES = 10_000  # [-], files and models that one world may include, one inside the other counted each time
MAX_DEPTH = 32  # [-], of includes inside includes


@dataclass
class _Model:
    """A model read: what is in it, relative to its own frame, and where that frame stands.

    Attributes
    ----------
    own : parts of its own links.
    nested : models inside, their X_RF relative to this one's frame.
    """

    name: str
    element: Element
    scope: Scope
    own: list[Part]
    nested: list[_Model]
    static: bool
    X_RF: pose.Pose
    relative_to: str

    @property
    def parts(self) -> list[Part]:
        """All parts, those of nested models under `model::part`."""
        inner = []
        for model in self.nested:
            prefix = "" if model.name.startswith("__merged") else f"{model.name}::"
            inner += [replace(part, X_BM=model.X_RF @ part.X_BM, name=prefix + part.name) for part in model.parts]
        return inner + self.own


def read_sdf(path: Path, search_path: Sequence[str | Path] = ()) -> World:
    """Read an SDF world or model file, or a model's folder.

    Raises
    ------
    SettingsError
        When the file is not SDF, or nothing in it can be seen.
    """
    reader = _Reader(SearchPath(path, search_path))
    root = reader.root(model_file(path))
    world = root.first("world")
    models = reader.world(world) if world is not None else reader.loose_models(root)
    bodies = reader.bodies(models)
    if not any(body.parts for body in bodies):
        reasons = "".join(f"\n  {line}" for line in reader.warnings[:5])
        raise SettingsError(f"holds nothing that a sonar can see{reasons}", str(path))
    return World(bodies, reader.warnings)


@dataclass
class _Reader:
    search: SearchPath
    included: int = 0
    _warned: dict[str, None] = field(default_factory=dict)  # an ordered set: a model included twice warns once

    def __post_init__(self) -> None:
        self.geometries = Geometries(self.search, self.warn)
        self.materials = Materials(self.search)
        self.unread = Unread(self.warn)
        self._roots: dict[Path, Element] = {}

    @property
    def warnings(self) -> list[str]:
        return list(self._warned)

    def warn(self, at: Element, message: str) -> None:
        self._warned.setdefault(f"{at.file}:{at.line}: <{at.tag}>: {message}")

    def left_out(self, error: SettingsError) -> None:
        self._warned.setdefault(f"{error}; left out")

    def root(self, path: Path) -> Element:
        if path not in self._roots:
            root = read_xml(path)
            if root.tag != "sdf":
                raise root.error("is not SDF: the file must begin with <sdf>")
            self.unread.version(root)
            self._roots[path] = root
        return self._roots[path]

    # ------------------------------------------------------------ worlds

    def world(self, world: Element) -> list[_Model]:
        """Return the models of a <world>, posed in it."""
        self.unread.inside(world)
        scope = Scope(own=("", "world", "__root__"))
        for frame in world.all("frame"):
            scope.add(frame, frame.attributes.get("name", ""), frame.attributes.get("attached_to", ""))
        models = self._models_in(world, scope, reflectance_of(world), ())
        return [model for model in models if self._placed(model, scope)]

    def loose_models(self, root: Element) -> list[_Model]:
        """Return the models of a file without a <world>."""
        self.unread.inside(root)
        scope = Scope(own=("", "world", "__root__"))
        models = self._models_in(root, scope, None, ())
        return [model for model in models if self._placed(model, scope)]

    def _placed(self, model: _Model, scope: Scope) -> bool:
        try:
            model.X_RF = scope.resolve(model.name, model.element)
        except SettingsError as error:
            self.left_out(error)
            return False
        return True

    def bodies(self, models: list[_Model]) -> list[Body]:
        return [Body(model.name, model.parts, model.X_RF, not model.static) for model in models]

    def _models_in(
        self, parent: Element, scope: Scope, reflectance: float | None, trail: tuple[Path, ...]
    ) -> list[_Model]:
        """Read the models and includes directly inside a world or model, and name them in its scope."""
        models = []
        for child in parent.children:
            if child.tag not in ("model", "include"):
                continue
            try:
                if child.tag == "model":
                    model = self.model(child, reflectance, trail)
                else:
                    model = self.include(child, reflectance, trail)
            except SettingsError as error:
                self.left_out(error)
                continue
            if child.attributes.get("merge", "") not in ("true", "1"):
                self._name(model, child, scope)
                models.append(model)
            elif "__model__" in scope.own:
                model.name = scope.merge(child, model.scope, model.X_RF, model.relative_to)
                models.append(model)
            else:
                models += self._merged_into_world(model, child, scope)
        return models

    def _merged_into_world(self, model: _Model, child: Element, scope: Scope) -> list[_Model]:
        """A world has no links, so the models inside become its own; links directly inside stay one model."""
        frame = scope.merge(child, model.scope, model.X_RF, model.relative_to)
        found = [
            replace(inside, element=child, relative_to=frame, static=model.static or inside.static)
            for inside in model.nested
        ]
        if model.own:
            found.append(replace(model, nested=[], X_RF=np.eye(4), relative_to=frame))
        for one in found:
            self._name(one, child, scope)
        return found

    def _name(self, model: _Model, child: Element, scope: Scope) -> None:
        if model.name in scope.nested or model.name in scope.frames:
            fresh = next(n for k in range(1, MAX_INCLUDES) if (n := f"{model.name}_{k}") not in scope.frames)
            self.warn(child, f"the name {model.name!r} is taken; called {fresh!r} here")
            model.name = fresh
        scope.nested[model.name] = model.scope
        scope.put(child, model.name, model.X_RF, model.relative_to)

    # ------------------------------------------------------------ models

    def model(self, element: Element, reflectance: float | None, trail: tuple[Path, ...]) -> _Model:
        """Read a <model> with everything inside."""
        self.unread.inside(element)
        reflectance = reflectance_of(element) or reflectance
        scope = Scope()
        for child in element.children:
            if child.tag in ("link", "frame", "joint"):
                self._frame(child, scope)
            if child.tag == "joint":
                self.unread.joint(child)
        nested = [m for m in self._models_in(element, scope, reflectance, trail) if self._placed(m, scope)]
        own = [part for link in element.all("link") for part in self._link(link, scope, reflectance)]
        at = element.first("pose")
        X_RF = read_pose(at)
        placement = element.attributes.get("placement_frame", "")
        if placement:
            X_RF = X_RF @ pose.inverse(scope.resolve(placement, element))
        static = truth(element.first("static"))
        name = element.attributes.get("name", "model")
        return _Model(name, element, scope, own, nested, static, X_RF, relative_name(at))

    def _frame(self, owner: Element, scope: Scope) -> None:
        defaults = {"link": "", "frame": owner.attributes.get("attached_to", ""), "joint": owner.text_at("child")}
        try:
            scope.add(owner, owner.attributes.get("name", ""), defaults[owner.tag])
        except SettingsError as error:
            self.left_out(error)

    def _link(self, link: Element, scope: Scope, reflectance: float | None) -> list[Part]:
        self.unread.inside(link)
        reflectance = reflectance_of(link) or reflectance
        shown = list(link.all("visual")) or list(link.all("collision"))
        return [part for visual in shown for part in self._visual(visual, link, scope, reflectance)]

    def _visual(self, visual: Element, link: Element, scope: Scope, reflectance: float | None) -> list[Part]:
        try:
            return self._visual_parts(visual, link, scope, reflectance)
        except SettingsError as error:
            self.left_out(error)
            return []

    def _visual_parts(self, visual: Element, link: Element, scope: Scope, reflectance: float | None) -> list[Part]:
        self.unread.inside(visual)
        at, geometry = visual.first("pose"), visual.first("geometry")
        if geometry is None:
            raise visual.error("must hold <geometry>")
        name = link.attributes.get("name", "")
        X = scope.resolve(relative_name(at) or name, visual) @ read_pose(at)
        parts = self.materials.dressed(self.geometries.read(geometry), visual, reflectance)
        full = f"{name}::{visual.attributes.get('name', '')}"
        return [replace(part, X_BM=X @ part.X_BM, name=full) for part in parts]

    # ------------------------------------------------------------ includes

    def include(self, element: Element, reflectance: float | None, trail: tuple[Path, ...]) -> _Model:
        """Read an <include>: another file's model under another name, pose and placement."""
        self.unread.inside(element)
        uri = element.first("uri")
        if uri is None or not uri.text:
            raise element.error("must hold <uri>")
        try:
            path = model_file(self.search.find(uri.text, uri.file))
        except ValueError as error:
            raise uri.error(str(error)) from None
        self._check(uri, path, trail)
        inner = self.root(path).first("model")
        if inner is None:
            raise uri.error(f"{path} holds no <model>")
        model = self.model(inner, reflectance_of(element) or reflectance, (*trail, path))
        return self._overridden(model, element)

    def _check(self, uri: Element, path: Path, trail: tuple[Path, ...]) -> None:
        if path in trail:
            circle = " -> ".join(place.parent.name or str(place) for place in (*trail[trail.index(path) :], path))
            raise uri.error(f"models include each other in a circle: {circle}")
        self.included += 1
        if len(trail) >= MAX_DEPTH or self.included > MAX_INCLUDES:
            raise uri.error(f"too many includes: at most {MAX_INCLUDES}, and {MAX_DEPTH} one inside the other")

    def _overridden(self, model: _Model, element: Element) -> _Model:
        model.element = element
        model.name = element.text_at("name") or model.name
        if element.first("static") is not None:
            model.static = truth(element.first("static"))
        placement, at = element.text_at("placement_frame"), element.first("pose")
        if at is not None:
            model.X_RF, model.relative_to = read_pose(at), relative_name(at)
        if placement:
            X_RF = read_pose(at) if at is not None else np.eye(4)
            model.X_RF = X_RF @ pose.inverse(model.scope.resolve(placement, element))
        return model
