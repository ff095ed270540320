"""Results of benchmarks as tables in the terminal and as plots."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table


def show(console: Console, results: dict[str, Any]) -> None:
    """Print every benchmark that was run."""
    if "tables" in results:
        _show_tables(console, results["tables"])
    for scene in results.get("error", []):
        _show_error(console, scene)
    if "scaling" in results:
        _show_scaling(console, results["scaling"])
    if "transport" in results:
        _show_transport(console, results["transport"])


def _show_tables(console: Console, rows: list[dict[str, Any]]) -> None:
    table = Table("beams", "bins", "fan [deg]", "accuracy", title="Paper's Tables 1 and 2, comparison scene, 30 m")
    for heading in ("mean [ms]", "sd", "median", "p99", "fps", "paper [ms]", "energy error", "mean error", "missed"):
        table.add_column(heading, justify="right")
    for row in rows:
        table.add_row(
            str(row["beams"]), str(row["bins"]), "{} x {}".format(*row["fan_deg"]), f"{row['accuracy']:g}",
            f"{row['mean_ms']:.2f}", f"{row['deviation_ms']:.2f}", f"{row['median_ms']:.2f}", f"{row['p99_ms']:.2f}",
            f"{row['fps']:.0f}", f"{row['paper_ms']:g}",
            *(f"{row[key]:.4f}" if key in row else "-" for key in ("energy_error", "mean_error", "missed")),
        )  # fmt: skip
    console.print(table)


def _show_error(console: Console, scene: dict[str, Any]) -> None:
    table = Table("way", "setting", title=f"Time against error, scene {scene['scene']}, 256 x 500, 120 x 20 deg")
    for heading in ("median [ms]", "energy error", "mean error", "missed", "false"):
        table.add_column(heading, justify="right")
    for way, points in scene["ways"].items():
        for point in points:
            setting = f"accuracy {point['accuracy']:g}" if "accuracy" in point else f"{point['samples']:,} samples"
            keys = ("energy_error", "mean_error", "missed", "false")
            table.add_row(way, setting, f"{point['median_ms']:.2f}", *(f"{point[key]:.4f}" for key in keys))
    console.print(table)
    ratio = scene["times_faster_at_0.02"]
    if ratio:
        console.print(f"At an energy error of 0.02 footprints are {ratio:.0f} times faster than one range per sample.")


def _show_scaling(console: Console, results: dict[str, Any]) -> None:
    table = Table("varied", title="Cost of a frame at accuracy 0.02 (256 x 500, 120 x 20 deg where not varied)")
    for heading in ("value", "median [ms]", "p99 [ms]", "first [ms]"):
        table.add_column(heading, justify="right")
    for row in results["rows"]:
        table.add_row(
            row["varied"],
            f"{row['value']:g}",
            f"{row['median_ms']:.2f}",
            f"{row['p99_ms']:.2f}",
            f"{row['first_ms']:.0f}",
        )
    console.print(table)
    _show_features(console, results["features"])
    _show_loading(console, results["loading"])
    start, memory = results["start"], results["memory"]
    console.print(
        f"Fresh process: imports {start['imports_s']:.2f} s, then {start['first_frame_s']:.2f} s to the first frame. "
        f"Memory over {memory['frames']:,} frames: {memory['grown_mb']:+.1f} MB."
    )


def _show_features(console: Console, rows: list[dict[str, Any]]) -> None:
    table = Table("feature", title="A feature off, on, and off again (51 200 triangles, every one with the feature)")
    for heading in ("off [ms]", "on [ms]", "off again [ms]", "off [kB]", "on [kB]", "off again [kB]"):
        table.add_column(heading, justify="right")
    for row in rows:
        times = (f"{row[f'{phase}_ms']:.2f}" for phase in ("off", "on", "off_again"))
        sizes = (f"{row[f'{phase}_bytes'] / 1e3:.1f}" for phase in ("off", "on", "off_again"))
        table.add_row(row["feature"].lower().replace("_", " "), *times, *sizes)
    console.print(table)


def _show_loading(console: Console, rows: list[dict[str, Any]]) -> None:
    table = Table("file", title="Loading a large world, in a process of its own")
    columns = {
        "triangles": "triangles", "file_mb": "file [MB]", "load_s": "load [s]", "peak_mb": "peak [MB]",
        "held_mb": "held [MB]", "describe_s": "describe [s]", "upload_s": "upload [s]", "gpu_mb": "GPU [MB]",
    }  # fmt: skip
    for heading in columns.values():
        table.add_column(heading, justify="right")
    for row in rows:
        table.add_row(row["file"], f"{row['triangles']:,}", *(f"{row[key]:.2f}" for key in list(columns)[1:]))
    console.print(table)


def _show_transport(console: Console, results: dict[str, Any]) -> None:
    table = Table("sample", title="Typed write to typed read over ipc, beside raw pyzmq in the same run")
    for heading in ("ours p50 [us]", "p99", "raw p50 [us]", "p99", "ours / raw", "target", "met"):
        table.add_column(heading, justify="right")
    for kind, row in ((kind, row) for kind, row in results.items() if isinstance(row, dict)):
        times = [f"{row[side][key]:.0f}" for side in ("ours_us", "raw_us") for key in ("p50", "p99")]
        met = "yes" if row["ratio"] <= row["target"] else "no"
        table.add_row(kind, *times, f"{row['ratio']:.2f}", f"<= {row['target']:g}", met)
    console.print(table)
    share, target = results["hz_cpu"], results["hz_target"]
    met = "met" if share <= target else "not met"
    console.print(f"sonar hz on 1 MB x 100 Hz: {share:.1%} of a core (target {target:.0%}: {met})")


def plot(results: dict[str, Any], folder: Path) -> list[Path]:
    """Draw time against error and the scaling curves; returns the files."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    files = []

    def save(figure: Any, name: str) -> None:
        FigureCanvasAgg(figure)
        figure.savefig(folder / name, dpi=90)
        files.append(folder / name)

    for scene in results.get("error", []):
        figure = Figure(figsize=(10, 4), layout="constrained")
        for axes, key in zip(figure.subplots(1, 2), ("energy_error", "mean_error"), strict=True):
            for (way, points), mark in zip(scene["ways"].items(), "os^", strict=True):
                if way == "one perspective image" and key == "energy_error":
                    continue  # every pixel worth the same is not an energy
                axes.loglog([p["median_ms"] for p in points], [p[key] for p in points], marker=mark, label=way)
            axes.axhline(0.02, color="grey", linewidth=0.8, linestyle=":")
            axes.set(xlabel="median time of a frame [ms]", ylabel=key.replace("_", " ") + " [-]")
            axes.grid(alpha=0.3, which="both")
            axes.legend()
        figure.suptitle(f"Scene {scene['scene']}: 256 beams x 500 bins, 120 x 20 deg")
        save(figure, f"error_{scene['scene']}.png")
    if "scaling" in results:
        rows = results["scaling"]["rows"]
        names = list(dict.fromkeys(row["varied"] for row in rows))
        figure = Figure(figsize=(12, 6), layout="constrained")
        for axes, name in zip(figure.subplots(2, -(-len(names) // 2)).ravel(), names, strict=False):
            chosen = [row for row in rows if row["varied"] == name]
            axes.plot([row["value"] for row in chosen], [row["median_ms"] for row in chosen], "o-")
            axes.set(xlabel=name, ylabel="median [ms]", ylim=(0, None))
            axes.grid(alpha=0.3)
        save(figure, "scaling.png")
    return files
