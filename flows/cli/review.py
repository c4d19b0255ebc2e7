"""`glint review`: the page in which a person sees captures, corrects their inputs and looks at their surfaces."""

import errno
import ipaddress
import os
import re
import socket
from collections.abc import Sequence
from typing import Annotated

import typer

from glint.flows.cli.options import Scheduler, Store, chosen_store
from glint.flows.cli.output import echo
from glint.flows.reporting.review_links import REVIEW_PORT

PORTS = 20
"""Number of ports that are tried, from REVIEW_PORT on."""
MIN_PASSWORD_CHARACTERS = 12
"""Fewest characters of a password for a page that other machines reach."""
ORIGIN = re.compile(r"(https?)://([\w.-]+|\[[\da-f:.]+\])(?::(\d+))?/?", re.ASCII)
"""What an address has that browsers send as Origin: a scheme, a host and perhaps a port."""
FOREIGN = (errno.EADDRNOTAVAIL, errno.EAFNOSUPPORT)
"""Errors of an address that is another machine's, or of a kind that this one does not have."""
USUAL_PORTS = {"http": 80, "https": 443}
"""Ports that browsers leave out of Origin and Host."""
END = "glint: the review page has stopped; what was saved is kept, and runs that it started continue"


def review(
    file: Annotated[
        str | None,
        typer.Argument(metavar="CATALOGUE", help="The catalogue's YAML file: shows captures that never ran, too."),
    ] = None,
    store: Store = None,
    port: Annotated[
        int | None, typer.Option(min=1, max=65535, help="Port (default: the first free from 4300).")
    ] = None,
    host: Annotated[
        str, typer.Option(help="Address to listen on; any but 127.0.0.1 requires $GLINT_REVIEW_PASSWORD.")
    ] = "127.0.0.1",
    origin: Annotated[
        list[str] | None,
        typer.Option(metavar="URL", help="Address under which browsers reach the page; may be given several times."),
    ] = None,
    scheduler: Scheduler = None,
) -> None:
    """Open the review page: see every capture, correct its inputs on the picture, run it, look at its surface."""
    import uvicorn

    from glint.flows.review.access import Access
    from glint.flows.review.app import create_app
    from glint.flows.review.kept_session import kept_session
    from glint.flows.runtime import signals
    from glint.flows.runtime.environment import prepare_environment
    from glint.storage.locations.location import Location
    from glint.storage.locations.store_folder import check_store
    from glint.tasks.engine.references import load_catalogue

    address = Location.parse(chosen_store(store)).uri
    if file is not None:
        load_catalogue(file)
    prepare_environment()
    password = _password(host)
    given = _origins(origin or (), host)
    # A service may start before the first run creates its store; for a person the path is misspelt.
    if file is None and password is None:
        check_store(Location.parse(address))
    listener = _listener(host, port)
    own = f"http://{f'[{host}]' if ':' in host else host}:{listener.getsockname()[1]}"
    origins = given or (own, own.replace("127.0.0.1", "localhost"))
    session = kept_session(origins[0], password)
    access = Access(origins, session=session) if password is None else Access(origins, password, session)
    config = uvicorn.Config(
        create_app(address, file, access, scheduler),
        log_level="warning",
        access_log=False,
        server_header=False,
        lifespan="on",
        timeout_graceful_shutdown=2,
    )
    echo(f"review page: {access.link() if password is None else f'{access.origins[0]}/open'}")
    echo(f"to bookmark: {access.origins[0]}/")
    echo("press Ctrl+C to stop the server; runs that it started continue")
    signals.describe_end(END)
    uvicorn.Server(config).run(sockets=[listener])


def _password(host: str) -> str | None:
    """Return the password that the user has set, None: a token is made.

    Raises:
        InputError: other machines could reach the page, and there is none; or it is short, or no text.
    """
    from glint.storage.errors import InputError, printable

    password = os.environ.get("GLINT_REVIEW_PASSWORD")
    if password is not None and printable(password) != password:
        raise InputError(
            "GLINT_REVIEW_PASSWORD holds characters that nobody can type", "choose letters, digits and signs, in UTF-8"
        )
    if password is not None and len(password) < MIN_PASSWORD_CHARACTERS:
        raise InputError(
            f"GLINT_REVIEW_PASSWORD has {len(password)} characters", f"choose {MIN_PASSWORD_CHARACTERS} or more"
        )
    try:
        is_loopback = ipaddress.ip_address(host).is_loopback
    except ValueError:
        raise InputError(f"--host {host} is not an address", "give an IP address, such as 127.0.0.1") from None
    if not is_loopback and password is None:
        raise InputError(
            f"--host {host} lets other machines reach the page without a password",
            "set GLINT_REVIEW_PASSWORD, and --origin to the address that browsers use",
        )
    return password


def _origins(given: Sequence[str], host: str) -> tuple[str, ...]:
    """Return the addresses of --origin as browsers send them.

    Raises:
        InputError: one is no such address, or there is none where that of --host is not one that browsers can use.
    """
    from glint.storage.errors import InputError

    if not given and ipaddress.ip_address(host).is_unspecified:
        raise InputError(
            f"--host {host} listens on every address of this machine, and browsers use one of them",
            "give that one with --origin, such as --origin http://192.168.1.20:4300",
        )
    origins = list[str]()
    for text in given:
        parts = ORIGIN.fullmatch(text.lower())
        port = int(parts[3]) if parts and parts[3] else None
        if parts is None or (port is not None and not 0 < port < 1 << 16):
            raise InputError(
                f"--origin {text} is not an address of the form http://HOST:PORT or https://HOST",
                "give the scheme, the host and any port, without a path, such as https://glint.example",
            )
        origins.append(f"{parts[1]}://{parts[2]}{'' if port in (None, USUAL_PORTS[parts[1]]) else f':{port}'}")
    return tuple(origins)


def _listener(host: str, port: int | None) -> socket.socket:
    """Return a socket that listens on the port, or on the first free one.

    Raises:
        InputError: none is free, the port cannot be used, or the address is another machine's.
    """
    from glint.storage.errors import InputError

    for number in (port,) if port is not None else range(REVIEW_PORT, REVIEW_PORT + PORTS):
        try:
            return _bound(host, number)
        except OSError as error:
            if error.errno in FOREIGN:
                message = f"--host {host} is not an address of this machine"
                raise InputError(message, "give one that it has, such as 127.0.0.1") from error
    if port is not None:
        raise InputError(f"port {port} of {host} is taken, or may not be used", "give another with --port")
    last = REVIEW_PORT + PORTS - 1
    raise InputError(f"no port from {REVIEW_PORT} to {last} is free at {host}", "give another with --port")


def _bound(host: str, port: int) -> socket.socket:
    """Return a socket that listens at an address.

    Raises:
        OSError: it cannot.
    """
    listener = socket.socket(socket.AF_INET6 if ":" in host else socket.AF_INET)
    try:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.bind((host, port))
        listener.listen()  # fails where another server has bound the port, too, and was faster
    except OSError:
        listener.close()
        raise
    return listener
