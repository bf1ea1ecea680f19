"""Pictures and videos of a grasp: which files can be written, and which picture is kept."""

import numpy as np
import pytest
from PIL import Image

from graspsense import load_pipeline
from graspsense.core.control.tick import RELEASE
from graspsense.core.values.errors import ConfigError, PluginUnavailable
from graspsense.core.values.signals import HOLD
from graspsense.report import film as module
from graspsense.report.film import Film


def plain(grey):
    return np.full((48, 64, 3), grey, np.uint8)


def filmed(film):
    """Show three pictures: the last one is of the release."""
    for grey, phase in ((10, HOLD), (120, HOLD), (250, RELEASE)):
        film.take(None, phase, None)
        film.picture(plain(grey))


def test_the_picture_is_the_last_one_before_the_release_and_a_video_has_all(tmp_path):
    picture = tmp_path / "p.png"
    film = Film(str(picture), None)
    filmed(film)
    assert film.write() == [picture]
    with Image.open(picture) as image:
        assert image.getpixel((0, 0)) == (120, 120, 120)
    for kind in ("gif", "webp"):
        video = tmp_path / f"v.{kind}"
        film = Film(None, str(video))
        filmed(film)
        assert film.write() == [video]
        with Image.open(video) as images:
            assert images.n_frames == 3


def test_a_video_that_cannot_be_written_is_refused_before_the_grasp(tmp_path, monkeypatch):
    monkeypatch.setattr(module, "find_spec", lambda name: None)
    with pytest.raises(PluginUnavailable, match=r"graspsense\[video\]"):
        Film(None, str(tmp_path / "v.mp4"))


def test_a_gripper_without_a_picture_says_so_before_it_opens(tmp_path):
    film = Film(str(tmp_path / "p.png"), None)
    with pytest.raises(ConfigError, match="no picture"):
        load_pipeline("default", options=["classifier.type=none"]).grasp(sinks=[film])
