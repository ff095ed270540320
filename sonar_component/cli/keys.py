"""`sonar keys`: who may read ports over the network."""

from __future__ import annotations

from pathlib import Path

import typer

from sonar_component.cli.run import print_json


def register(app: typer.Typer) -> None:
    """Add the verbs."""
    keys = typer.Typer(no_args_is_help=True, help="Keys for ports that leave the host.")
    keys.command("new")(new)
    keys.command("allow")(allow)
    keys.command("list")(list_keys)
    app.add_typer(keys, name="keys")


def new(name: str = typer.Argument(..., help="Of the host, as in the deployment's hosts.")) -> None:
    """Make a pair of keys."""
    from sonar_component.middleware.transport.keys import new_keys

    public = new_keys(name)
    print(f"{public}: give this file to the other hosts; there: sonar keys allow {public.name}")


def allow(file: Path = typer.Argument(..., help="Public key (.key) of somebody else.")) -> None:
    """Let the owner of a public key connect."""
    from sonar_component.middleware.transport.keys import allow

    print(f"{allow(file)}: allowed from the next start of a deployment on")


def list_keys(as_json: bool = typer.Option(False, "--json", help="Print JSON.")) -> None:
    """List own and allowed keys."""
    from sonar_component.middleware.transport.keys import key_folder, own_names

    folder = key_folder()
    found = {
        "own": [str(folder / f"{name}.key") for name in own_names()],
        "allowed": sorted(str(file) for file in (folder / "allowed").glob("*.key")),
    }
    if as_json:
        print_json(found)
        return
    for kind, files in found.items():
        for file in files:
            print(f"{kind:<8} {file}")
