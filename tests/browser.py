"""A headless Chromium that tests drive by the DevTools protocol through two pipes."""

import base64
import fcntl
import json
import os
import select
import shutil
import subprocess
import tempfile
from itertools import count
from pathlib import Path

import pytest

NAMES = ("chromium", "chromium-browser", "google-chrome", "chrome")
REQUIRED = "GRASPSENSE_REQUIRE_BROWSER"
"""Environment variable that turns a missing browser into a failure."""

PATIENCE_S = 120


def start():
    """Return a running browser; skip the test where there is none, or fail where one is required."""
    path = next((path for name in NAMES if (path := shutil.which(name))), None)
    if path is None:
        reason = f"no Chromium here ({', '.join(NAMES)}): apt-get install chromium"
        (pytest.fail if os.environ.get(REQUIRED) else pytest.skip)(reason)
    return Browser(path)


def above_ten(descriptor):
    """Move a descriptor out of the way of those that a shell names by one digit."""
    moved = fcntl.fcntl(descriptor, fcntl.F_DUPFD, 10)
    os.close(descriptor)
    return moved


class Browser:
    """One page in a browser. `close` ends the process."""

    def __init__(self, path):
        self.folder = tempfile.TemporaryDirectory(prefix="graspsense-browser-", ignore_cleanup_errors=True)
        commands, self.commands = os.pipe()
        self.answers, answers = os.pipe()
        options = ["--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", "--no-first-run"]
        options += ["--disable-dev-shm-usage", "--remote-debugging-pipe"]
        # The protocol wants its pipes at the descriptors 3 and 4.
        commands, answers = above_ten(commands), above_ten(answers)
        shell = f'exec "$0" "$@" 3<&{commands} 4>&{answers}'
        self.process = subprocess.Popen(
            ["bash", "-c", shell, path, *options, f"--user-data-dir={self.folder.name}", "about:blank"],
            pass_fds=(commands, answers),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        os.close(commands)
        os.close(answers)
        self.numbers, self.rest, self.session, self.events = count(1), b"", None, []
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        self.session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        self.call("Page.enable")

    def close(self):
        """End the browser."""
        self.process.kill()
        self.process.wait()
        os.close(self.commands)
        os.close(self.answers)
        self.folder.cleanup()

    def call(self, method, **params):
        """Send a command and return its result."""
        number = next(self.numbers)
        message = {"id": number, "method": method, "params": params}
        if self.session:
            message["sessionId"] = self.session
        os.write(self.commands, json.dumps(message).encode() + b"\0")
        while True:
            answer = self.message()
            if answer.get("id") == number:
                assert "error" not in answer, answer["error"]
                return answer["result"]
            self.events.append(answer)

    def message(self):
        """Return the next message of the browser."""
        while b"\0" not in self.rest:
            readable, _, _ = select.select([self.answers], [], [], PATIENCE_S)
            assert readable, f"the browser has not answered for {PATIENCE_S} s"
            got = os.read(self.answers, 1 << 16)
            assert got, "the browser has ended"
            self.rest += got
        text, _, self.rest = self.rest.partition(b"\0")
        return json.loads(text)

    def show(self, path, width, *, dark=False, media="screen", height=900):
        """Load a page, a file or an address, at this width, in light or dark."""
        features = [{"name": "prefers-color-scheme", "value": "dark" if dark else "light"}]
        self.call("Emulation.setEmulatedMedia", media=media, features=features)
        self.call(
            "Emulation.setDeviceMetricsOverride",
            width=width,
            height=height,
            deviceScaleFactor=1,
            mobile=False,
        )
        self.events.clear()
        self.call(
            "Page.navigate", url=path if str(path).startswith("http") else Path(path).resolve().as_uri()
        )
        while not any(event.get("method") == "Page.loadEventFired" for event in self.events):
            self.events.append(self.message())

    def run(self, script):
        """Return the value of an expression on the page."""
        result = self.call("Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in result, result["exceptionDetails"]
        return result["result"].get("value")

    def mouse(self, kind, x, y, clicks=0):
        """Move, press or release the mouse at a place of the window."""
        held = {"mousePressed": 1, "mouseMoved": clicks}.get(kind, 0)
        button = "left" if clicks else "none"
        self.call(
            "Input.dispatchMouseEvent",
            type=kind,
            x=x,
            y=y,
            button=button,
            buttons=held,
            clickCount=clicks,
        )

    def drag(self, start, end):
        """Press the mouse at one place and release it at another."""
        self.mouse("mouseMoved", *start)
        self.mouse("mousePressed", *start, clicks=1)
        self.mouse("mouseMoved", *end, clicks=1)
        self.mouse("mouseReleased", *end, clicks=1)

    def double_click(self, place):
        """Click twice."""
        for clicks in (1, 2):
            self.mouse("mousePressed", *place, clicks=clicks)
            self.mouse("mouseReleased", *place, clicks=clicks)

    def screenshot(self, path):
        """Write the whole page as a PNG."""
        data = self.call("Page.captureScreenshot", captureBeyondViewport=True)["data"]
        Path(path).write_bytes(base64.b64decode(data))

    def pdf(self):
        """Return the page as it is printed."""
        return base64.b64decode(self.call("Page.printToPDF", printBackground=True)["data"])
