"""`--live`: a page of the grasps of a command, and the observers of plugins, while they go on."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, Final, TypeVar

import click

from graspsense.cli.terminal import talk, warn

if TYPE_CHECKING:
    from graspsense.core.values.trial import Trial
    from graspsense.live.feeds import LiveFeed

_Command = TypeVar("_Command", bound=Callable[..., Any])
HINT: Final = "--live needs the package websockets: pip install 'graspsense[live]'"
ROWS: Final = 12
"""Grasps of the store that the page lists."""


def live_options(command: _Command) -> _Command:
    """Add `--live` and `--live-address` to a command."""
    command = click.option(
        "--live-address",
        metavar="HOST[:PORT]",
        help="--live on another address than loopback, or on a port that you choose.",
    )(command)
    return click.option("--live", is_flag=True, help="Show it on a page in the browser while it goes on.")(
        command
    )


class Live:
    """What shows the grasps of a command while they go on: `sinks` for the runner, none if that is not asked for."""

    def __init__(self, sinks: Sequence[LiveFeed] = ()) -> None:
        self.sinks = tuple(sinks)

    def finished(self, trial: Trial, save: str | None = None) -> None:
        """Show how a grasp ended, and the last grasps of the store in which it was saved."""
        for sink in self.sinks:
            sink.finished(trial)
        if save is not None and self.sinks:
            self.told("stored", {"rows": _last_grasps(save)})

    def told(self, name: str, values: Any) -> None:
        """Pass on JSON values."""
        for sink in self.sinks:
            sink.told(name, values)

    def close(self) -> None:
        """End the page and the observers, and print what was wrong with them."""
        for sink in self.sinks:
            error = sink.close()
            if error:
                warn(error)
            if sink.dropped:
                warn(f"{sink.name} could not follow: {sink.dropped} messages are missing there")


@contextmanager
def shown_live(live: bool, address: str | None, save: str | None = None) -> Iterator[Live]:
    """Serve the page in this context, and print its address; nothing is shown if neither is given.

    At a terminal, the page remains until Ctrl-C. Raises PluginUnavailable without the package websockets, and
    ConfigError if the address cannot be used.
    """
    if not live and address is None:
        yield Live()
        return
    shown = _started(*_host_and_port(address))
    try:
        if save is not None:
            shown.told("stored", {"rows": _last_grasps(save)})
        yield shown
        if sys.stderr.isatty():
            talk("the page remains: Ctrl-C ends it")
            _wait_for_interrupt()
    finally:
        shown.close()


def _wait_for_interrupt() -> None:
    from threading import Event

    try:
        Event().wait()
    except KeyboardInterrupt:
        talk("")


def _started(host: str, port: int) -> Live:
    from importlib.util import find_spec

    from graspsense.core.components.registry import installed
    from graspsense.core.values.errors import ConfigError, PluginUnavailable
    from graspsense.live.feeds import LiveFeed

    if find_spec("websockets") is None:
        raise PluginUnavailable(HINT)
    page = LiveFeed("graspsense.live.page_process", [host, str(port)])
    talk(f"live: {page.answer['address']}")
    feeds = [page]
    for observer in installed().live_observers():
        try:
            feeds.append(LiveFeed("graspsense.live.observer_process", [observer.entry.target]))
        except ConfigError as error:
            needs = f": {observer.entry.needs}" if observer.entry.needs else ""
            warn(f"live observer {observer.qualified}: {error}{needs}")
    return Live(feeds)


def _host_and_port(address: str | None) -> tuple[str, int]:
    """Return host and port of `HOST`, `HOST:PORT` or `[HOST]:PORT`; port 0 is a free one. Raises UsageError."""
    if address is None:
        return "127.0.0.1", 0
    host, colon, port = address, "", ""
    if address.startswith("[") or address.count(":") == 1:
        host, colon, port = address.rpartition(":") if not address.endswith("]") else (address, "", "")
    host = host.removeprefix("[").removesuffix("]")
    if not host or (colon and not (port.isascii() and port.isdigit() and int(port) < 65536)):
        raise click.UsageError(
            f"--live-address is {address!r}: write HOST or HOST:PORT, as in 127.0.0.1:8700, with a port up to 65535"
        )
    return host, int(port or 0)


def _last_grasps(save: str) -> list[list[str]]:
    """Return number, label, outcome and prediction of the last grasps of a store; none where there is no store yet."""
    from graspsense.core.values.errors import GraspsenseError
    from graspsense.store.store import Store

    rows = []
    try:
        with Store.read(save) as store:
            for summary in store.page(limit=ROWS):
                prediction = store.trial(summary.id).result.details.get("prediction")
                predicted = prediction["label"] if prediction else "-"
                rows.append([str(summary.id), summary.label or "-", summary.outcome, predicted])
    except GraspsenseError:  # whoever writes to the store reports what is wrong with it
        return []
    return rows
