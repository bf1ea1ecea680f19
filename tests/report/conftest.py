import browser as browsers
import pytest

from graspsense.live.feeds import LiveFeed


@pytest.fixture(scope="module")
def browser():
    running = browsers.start()
    yield running
    running.close()


@pytest.fixture
def feed():
    running = LiveFeed("graspsense.live.page_process", ["127.0.0.1", "0"])
    yield running
    assert running.close() == ""
