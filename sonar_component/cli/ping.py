"""`sonar ping`: one image of a scene from one pose, without any port."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import typer

if TYPE_CHECKING:
    from sonar_component.samples import RigidBodyState, Sonar
    from sonar_component.scene.world import World
    from sonar_component.sonars.feature_costs import FeatureCost
    from sonar_component.sonars.forward_looking import ForwardLookingSonar
    from sonar_component.sonars.scanning import ScanningSonar
    from sonar_component.sonars.scanning_settings import ScanningSettings
    from sonar_component.sonars.settings import ForwardLookingSettings

    Simulator = ForwardLookingSonar | ScanningSonar
    Settings = ForwardLookingSettings | ScanningSettings


def register(app: typer.Typer) -> None:
    """Add the verb."""
    app.command("ping")(ping)


def ping(
    scene: Path = typer.Option(..., help="Scene YAML, SDF world, or a mesh file (metres, Z up)."),
    sonar: Path | None = typer.Option(None, help="Sonar YAML, such as configs/sonars/gemini_720i.yaml."),
    settings: list[str] = typer.Option([], "--set", metavar="NAME=VALUE", help="Overrides the sonar YAML."),
    position: tuple[float, float, float] = typer.Option((0.0, 0.0, 0.0), help="Of the sonar [m]: X Y Z, Z up."),
    rpy_deg: tuple[float, float, float] | None = typer.Option(
        None, help="Roll, pitch (positive is nose down) and yaw (positive is left) [deg]."
    ),
    quaternion: tuple[float, float, float, float] | None = typer.Option(None, help="Orientation instead: W X Y Z."),
    bearing_deg: float | None = typer.Option(
        None, help="Where the head of a scanning sonar looks, positive is left [deg]; its start otherwise."
    ),
    scan: bool = typer.Option(False, "--scan", help="A full scan of a scanning sonar that stands still."),
    noise: Literal["on", "off"] | None = typer.Option(None, help="Speckle; the sonar's own setting otherwise."),
    truth: bool = typer.Option(False, "--truth", help="Add what stands behind each bin to the .npz."),
    explain: bool = typer.Option(
        False, "--explain", help="Say which samples and features were chosen, why, and what each costs."
    ),
    as_json: bool = typer.Option(False, "--json", help="Print a summary for machines."),
    out: Path = typer.Option(..., help="FILE.npz for the numbers or FILE.png for a picture."),
) -> None:
    """Render one sonar image."""
    import numpy as np

    from sonar_component.scene import load_world
    from sonar_component.settings.errors import SettingsError
    from sonar_component.settings.paths import find_file

    _check_out(out, truth)
    pose = _pose(position, rpy_deg, quaternion)
    chosen = load_settings(sonar, settings)
    _check_head(chosen, bearing_deg, scan, truth)
    if noise is not None:
        chosen.enable_speckle_noise = noise == "on"
    try:
        world = load_world(find_file(scene))
    except ValueError as error:
        raise error if isinstance(error, SettingsError) else SettingsError(str(error), str(scene)) from None
    simulator = _simulator(chosen, bearing_deg)
    rng = np.random.default_rng(chosen.seed)
    sample = _full_scan(simulator, world, pose, rng) if scan else simulator.ping(world, pose, rng)
    _write(out, sample, simulator.truth(world, pose) if truth else None, simulator, world, pose)
    lines = list(world.warnings) + chosen.doubts() + simulator.remarks(sample)
    costs = simulator.feature_costs(world, pose) if explain else []
    _report(out, sample, simulator, lines, costs, as_json)


def _check_out(out: Path, truth: bool) -> None:
    from sonar_component.settings.errors import SettingsError

    if out.suffix not in (".npz", ".png"):
        raise SettingsError(f"--out must end in .npz or .png, got {str(out)!r}")
    if not out.absolute().parent.is_dir():
        raise SettingsError(f"--out: there is no folder {out.parent}")
    if out.is_dir():
        raise SettingsError(f"--out: {out} is a folder")
    if truth and out.suffix != ".npz":
        raise SettingsError("--truth needs --out FILE.npz: a picture has no place for it")


def _check_head(chosen: Settings, bearing_deg: float | None, scan: bool, truth: bool) -> None:
    from sonar_component.settings.errors import SettingsError

    if chosen.kind != "scanning" and (scan or bearing_deg is not None):
        option = "--scan" if scan else "--bearing-deg"
        raise SettingsError(f"{option} is for scanning sonars; the settings are of kind {chosen.kind}")
    if scan and (truth or bearing_deg is not None):
        raise SettingsError(f"--scan does not go with {'--truth' if truth else '--bearing-deg'}: give one of them")
    if bearing_deg is not None and not -360 <= bearing_deg <= 360:
        raise SettingsError(f"--bearing-deg must be -360 to 360, got {bearing_deg:g}")


def _simulator(chosen: Settings, bearing_deg: float | None) -> Simulator:
    import math

    from sonar_component.sonars.forward_looking import ForwardLookingSonar
    from sonar_component.sonars.scanning import ScanningSonar
    from sonar_component.sonars.scanning_settings import ScanningSettings

    if not isinstance(chosen, ScanningSettings):
        return ForwardLookingSonar(_context(), chosen)
    simulator = ScanningSonar(_context(), chosen)
    if bearing_deg is not None:
        simulator.head.look_at(math.radians(bearing_deg), exactly=True)
    return simulator


def _full_scan(simulator: Simulator, world: World, pose: RigidBodyState, rng: Any) -> Sonar:
    """One beam from each place, as if the vehicle and time stood still."""
    from dataclasses import replace

    from sonar_component.sonars.scan import Scan
    from sonar_component.sonars.scanning import ScanningSonar

    assert isinstance(simulator, ScanningSonar)
    head = simulator.head
    scan = Scan(head.bearings(), simulator.settings.motor_step)
    for number in range(2 * head.places):  # from a start within the sector, the way back is needed too
        scan.add(head.place, simulator.ping(world, replace(pose, time=number + 1), rng))
        head.advance()
        if scan.filled == 1:
            break
    return replace(scan.sample(), time=pose.time)


def _context() -> Any:
    from sonar_component.gl import GLUnavailableError, create_context
    from sonar_component.settings.errors import SettingsError

    try:
        return create_context()
    except GLUnavailableError as error:
        # Nothing has begun, and what to install is said: like any other condition that is not met.
        raise SettingsError(str(error)) from None


def _pose(position: tuple[float, ...], rpy_deg: Any, quaternion: Any) -> RigidBodyState:
    import numpy as np

    from sonar_component.samples.rigid_body_state import RigidBodyState, quaternion_from_rpy
    from sonar_component.settings.errors import SettingsError

    if rpy_deg is not None and quaternion is not None:
        raise SettingsError("give --rpy-deg or --quaternion, not both")
    q = quaternion_from_rpy(*np.radians(rpy_deg or (0.0, 0.0, 0.0)))
    if quaternion is not None:
        q = np.array(quaternion)
        length = float(np.linalg.norm(q))
        if not (np.isfinite(length) and length > 0):
            raise SettingsError(f"--quaternion must be 4 finite numbers that are not all 0, got {list(quaternion)}")
        q = q / length
    pose = RigidBodyState(
        time=0, sourceFrame="sonar", targetFrame="world", position=np.array(position, np.float64), orientation=q
    )
    try:
        pose.validate()
    except ValueError as error:
        raise SettingsError(f"--position, --rpy-deg: {error}") from None
    return pose


def load_settings(sonar: Path | None, overrides: list[str]) -> Settings:
    """The settings of a sonar's YAML with NAME=VALUE laid over; of the standard sonar without a file."""
    from sonar_component.settings.loader import Document, load_yaml, overlay
    from sonar_component.settings.paths import find_file
    from sonar_component.settings.validation import validate
    from sonar_component.sonars.scanning_settings import ScanningSettings
    from sonar_component.sonars.settings import ForwardLookingSettings

    document = load_yaml(find_file(sonar)) if sonar is not None else Document({}, "sonar")
    document = overlay(document, overrides, "--set")
    kind = document.at(("kind",)) or "forward_looking"
    if kind not in ("forward_looking", "scanning"):
        raise document.error(("kind",), f"must be forward_looking or scanning, got {kind!r}")
    return validate(ScanningSettings, document) if kind == "scanning" else validate(ForwardLookingSettings, document)


def _write(out: Path, sample: Sonar, truth: Any, simulator: Simulator, world: Any, pose: RigidBodyState) -> None:
    import numpy as np

    if out.suffix == ".png":
        from sonar_component.pictures.figure import save_png

        save_png(sample, out, name=out.stem)
        return
    names = "bins bearings bin_duration speed_of_sound beam_width beam_height time".split()
    arrays = {name: np.asarray(getattr(sample, name)) for name in names}
    if truth is not None:
        clean = simulator.ping(world, pose).bins
        arrays |= {
            "clean": clean, "elevation": truth.elevation, "range": truth.range,
            "object_id": truth.object_id, "hit_weight": truth.weight, "object_names": np.array(list(world.bodies)),
        }  # fmt: skip
    np.savez(out, **arrays)  # type: ignore[arg-type]  # its stub takes a keyword for its own flag


def _report(
    out: Path, sample: Sonar, simulator: Simulator, lines: list[str], costs: list[FeatureCost], as_json: bool
) -> None:
    lit = float((sample.bins > 0).mean())
    if as_json:
        summary = {
            "file": str(out), "beam_count": sample.beam_count, "bin_count": sample.bin_count,
            "bin_length_m": sample.bin_length, "lit": lit, "greatest": float(sample.bins.max()),
            "warnings": lines, "plan": simulator.explain(), "features": [cost.data() for cost in costs],
        }  # fmt: skip
        print(json.dumps(summary))
        return
    print(
        f"{out}: {sample.beam_count} beams x {sample.bin_count} bins of {sample.bin_length:.4g} m, "
        f"{100 * lit:.0f} % of them lit, strongest echo {sample.bins.max():.3g}"
    )
    for line in lines:
        typer.echo(f"warning: {line}", err=True)
    if costs:
        for line in [*simulator.explain(), *(cost.line() for cost in costs)]:
            print(f"  {line}")
