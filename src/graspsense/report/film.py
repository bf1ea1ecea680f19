"""Pictures and a video of a grasp, from a gripper that can be seen (`SensorBackend.see`)."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
from typing import Any, Final

from graspsense.core.control.tick import RELEASE
from graspsense.core.values.errors import ConfigError, PluginUnavailable
from graspsense.core.values.signals import Command, Reading

FRAMES_HZ: Final = 25.0
PACKAGES: Final = {".png": "PIL", ".gif": "PIL", ".webp": "PIL", ".mp4": "av"}
"""The package that writes each kind of file."""
HINTS: Final = {
    "PIL": "pictures need Pillow: pip install 'graspsense[plot]'",
    "av": "a video as MP4 needs PyAV: pip install 'graspsense[video]', or write it as .webp or .gif",
}


class Film:
    """A sink that keeps the pictures of a grasp, and writes them when it is over.

    The picture is the last one before the release. `window` asks for a window besides.
    """

    def __init__(self, picture: str | None, video: str | None, *, window: bool = False) -> None:
        """Raises PluginUnavailable, before the grasp, without the package that writes a file."""
        self.window = window
        self.frames_hz = FRAMES_HZ if picture is not None or video is not None else 0.0
        self._picture, self._video = (
            None if name is None else _checked(Path(name)) for name in (picture, video)
        )
        self._last: Any = None
        self._frames: list[Any] = []
        self._is_over = False

    def take(self, reading: Reading, phase: int, command: Command) -> None:
        """Note when the release begins."""
        del reading, command
        self._is_over = phase == RELEASE

    def picture(self, image: Any) -> None:
        """Keep a picture: rows x columns x 3 values from 0 to 255."""
        if not self._is_over:
            self._last = image
        if self._video is not None:
            self._frames.append(image)

    def write(self) -> list[Path]:
        """Write the files and return their paths. Raises ConfigError where that fails."""
        written = []
        try:
            if self._picture is not None and self._last is not None:
                _image(self._last).save(self._picture)
                written.append(self._picture)
            if self._video is not None and self._frames:
                _write_video(self._video, self._frames)
                written.append(self._video)
        except OSError as error:
            raise ConfigError(f"the pictures of the grasp cannot be written: {error}") from error
        return written

    def png(self) -> bytes | None:
        """Return the picture as a PNG file; None without one."""
        from io import BytesIO

        if self._last is None:
            return None
        file = BytesIO()
        _image(self._last).save(file, "png")
        return file.getvalue()


def picture_of_trial(folder: str, number: int) -> Path:
    """Return where the picture of a trial of a store is, if it has one."""
    return Path(folder) / f"picture-{number}.png"


def _checked(path: Path) -> Path:
    package = PACKAGES[path.suffix.lower()]
    if find_spec(package) is None:
        raise PluginUnavailable(HINTS[package])
    return path


def _image(pixels: Any) -> Any:
    from PIL import Image

    return Image.fromarray(pixels)


def _write_video(path: Path, frames: list[Any]) -> None:
    if path.suffix.lower() == ".mp4":
        _write_mp4(path, frames)
        return
    images = [_image(frame) for frame in frames]
    images[0].save(path, save_all=True, append_images=images[1:], duration=1000.0 / FRAMES_HZ, loop=0)


def _write_mp4(path: Path, frames: list[Any]) -> None:
    import av

    with av.open(str(path), "w") as container:
        stream = container.add_stream("libx264", rate=round(FRAMES_HZ))
        stream.height, stream.width = frames[0].shape[:2]
        stream.pix_fmt = "yuv420p"
        for frame in frames:
            container.mux(stream.encode(av.VideoFrame.from_ndarray(frame, format="rgb24")))
        container.mux(stream.encode())
