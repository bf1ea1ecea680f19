"""`--live`, `--foxglove`, `--rerun`: the grasps of a command while they go on, on a page and in other viewers."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from threading import Event
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import click

from graspsense.cli.options import option_group
from graspsense.cli.terminal import talk, warn
from graspsense.core.components.entries import LiveObserverEntry
from graspsense.core.components.registry import installed
from graspsense.core.values.errors import ConfigError, GraspsenseError, PluginUnavailable

if TYPE_CHECKING:
    from graspsense.core.values.trial import Trial
    from graspsense.live.feeds import LiveFeed

EXTRAS: Final = {
    "--live": ("websockets",),
    "--foxglove": ("foxglove", "websockets"),
    "--rerun": ("rerun",),
}
"""The modules that each option needs; the extra has the name of the option."""
RERUN_VIEWER: Final = "rerun+http://127.0.0.1:9876/proxy"
"""Where a viewer of Rerun listens that was started by `rerun`."""
ROWS: Final = 12
"""Grasps of the store that the page lists."""


class LiveOptions(NamedTuple):
    """What is to show the grasps of a command: the options."""

    live: bool = False
    live_address: str | None = None
    foxglove: int | None = None
    rerun: str | None = None

    @classmethod
    def taken_from(cls, asked: dict[str, Any]) -> LiveOptions:
        """Return these of the options of a command, and remove them from the others."""
        return cls(*(asked.pop(name) for name in cls._fields))

    @property
    def page(self) -> bool:
        """Whether there is to be a page."""
        return self.live or self.live_address is not None


live_options = option_group(
    click.option("--live", is_flag=True, help="Show the progress on a page in the browser."),
    click.option(
        "--live-address",
        metavar="HOST[:PORT]",
        help="Serve the page of --live on this address or port, instead of on loopback.",
    ),
)
viewer_options = option_group(
    click.option(
        "--foxglove",
        is_flag=False,
        flag_value=0,
        type=click.IntRange(0, 65535),
        metavar="[PORT]",
        help="Stream the grasp to Foxglove.",
    ),
    click.option(
        "--rerun",
        is_flag=False,
        flag_value=RERUN_VIEWER,
        metavar="[FILE.rrd]",
        help="Log the grasp to a new file of Rerun, or to a Rerun viewer that is running.",
    ),
)
"""For a command with `live_options` that grasps."""


class Live:
    """What shows the grasps of a command while they go on: `sinks` for the runner, none if that is not asked for."""

    def __init__(self, sinks: Sequence[LiveFeed]) -> None:
        self.sinks = sinks

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
        """End what shows the grasps, and print what was wrong with it."""
        for sink in self.sinks:
            error = sink.close()
            if error:
                warn(error)
            if sink.dropped:
                warn(f"{sink.name} could not follow: {sink.dropped} messages are missing there")


@contextmanager
def shown_live(asked: LiveOptions, save: str | None = None) -> Iterator[Live]:
    """Show in this context what is asked for, and print its addresses.

    At a terminal, what is served remains until Ctrl-C. Raises PluginUnavailable without the package that is needed, and
    ConfigError if an address or a file cannot be used.
    """
    feeds: list[LiveFeed] = []
    shown = Live(feeds)
    try:
        _start(asked, feeds)
        if save is not None:
            shown.told("stored", {"rows": _last_grasps(save)})
        yield shown
        if sys.stderr and sys.stderr.isatty() and (asked.page or asked.foxglove is not None):
            talk("the grasps can still be seen: Ctrl-C ends it")
            with suppress(KeyboardInterrupt):
                Event().wait()
    finally:
        shown.close()


def _start(asked: LiveOptions, feeds: list[LiveFeed]) -> None:
    """Start what is asked for, and add it to the feeds."""
    if asked.page:
        host, port = _host_and_port(asked.live_address)
        feeds.append(_started("--live", "page", host, str(port)))
        feeds += _observers()
    if asked.foxglove is not None:
        feeds.append(_started("--foxglove", "foxglove", str(asked.foxglove)))
    if asked.rerun is not None:
        feeds.append(_started("--rerun", "rerun", _rerun_target(asked.rerun)))


def _started(option: str, name: str, *arguments: str) -> LiveFeed:
    """Start the process of an option, and print its address."""
    from importlib.util import find_spec

    from graspsense.live.feeds import END_TIMEOUT_S, FILE_TIMEOUT_S, LiveFeed

    extra = option.removeprefix("--")
    if any(find_spec(module) is None for module in EXTRAS[option]):
        raise PluginUnavailable(f"{option} needs a further package: pip install 'graspsense[{extra}]'")
    timeout_s = FILE_TIMEOUT_S if arguments[0].endswith(".rrd") else END_TIMEOUT_S
    feed = LiveFeed(f"graspsense.live.{name}_process", arguments, timeout_s)
    talk(f"{extra}: {feed.answer['address']}")
    return feed


def _rerun_target(target: str) -> str:
    """Return the new file or the address of a viewer. Raises UsageError for what is neither."""
    from urllib.parse import urlsplit

    if target.endswith(".rrd"):
        if os.path.exists(target):
            raise click.UsageError(f"--rerun: {target} already exists: name another file, or move it away")
        return target
    with suppress(ValueError):  # a port that is none
        address = urlsplit(target)
        if address.scheme == "rerun+http" and address.hostname and address.port and address.path == "/proxy":
            return target
    raise click.UsageError(
        f"--rerun is {target!r}: name a file that ends in .rrd, or a viewer as in {RERUN_VIEWER}"
    )


def _observers() -> list[LiveFeed]:
    """Start the observers of plugins, and print which cannot be."""
    from graspsense.live.feeds import LiveFeed

    feeds = []
    for observer in installed().resources(LiveObserverEntry):
        try:
            feeds.append(LiveFeed("graspsense.live.observer_process", [observer.entry.target]))
        except ConfigError as error:
            needs = f": {observer.entry.needs}" if observer.entry.needs else ""
            warn(f"live observer {observer.qualified}: {error}{needs}")
    return feeds


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
