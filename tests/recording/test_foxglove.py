"""Pictures of tactile images in an exported recording, as another program's reader of ROS 2 messages sees them."""

import numpy as np
import pytest
from kept import write_recording
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

from graspsense import load_pipeline
from graspsense.core.components.registry import installed
from graspsense.core.values.channel import TactileArray
from graspsense.core.values.errors import ConfigError
from graspsense.recording.export_trace import write_mcap, write_pictures
from graspsense.recording.foxglove import CELL_PIXELS, RAW_IMAGE, _grid_of
from graspsense.recording.reader import read_recorded
from graspsense.store.record_grasp import record_grasp
from graspsense.store.store import Store


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    """A grasp of the simulated gripper, its recording, and a copy of it with pictures."""
    folder = tmp_path_factory.mktemp("grasp") / "trials"
    settings = load_pipeline(
        options=["classifier.type=none", "gripper.object=can:full_open", "gripper.rate_hz=250"]
    ).settings
    with Store.open(folder) as store:
        trial = record_grasp(store, settings, installed(), labels={}, origin="run").trial
    (path,) = (folder / "recordings").glob("*.mcap")
    write_pictures(folder / "pictures.mcap", read_recorded(path))
    return trial, path, folder / "pictures.mcap"


def decoded(path):
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        return [
            (channel.topic, schema.name, message, value)
            for schema, channel, message, value in reader.iter_decoded_messages(log_time_order=False)
        ]


@pytest.mark.slow
def test_every_tactile_image_is_followed_by_its_pictures(recording):
    trial, _, pictures = recording
    messages = decoded(pictures)
    topics = [topic for topic, *_ in messages if topic != "/grasp/tick"]
    images = len(trial.trace.pad_t_s)
    assert topics == ["/grasp/pads", "/grasp/pictures/pads_left", "/grasp/pictures/pads_right"] * images
    brightest = 0
    for topic, schema, message, value in messages:
        if not topic.startswith("/grasp/pictures/"):
            continue
        assert (schema, value.encoding, value.frame_id) == (RAW_IMAGE, "mono8", topic.rsplit("_", 1)[1])
        # The face of a fingertip has five rows of three cells; the seven cells beside it have no position there.
        assert (value.height, value.width, value.step) == (5 * CELL_PIXELS, 3 * CELL_PIXELS, 3 * CELL_PIXELS)
        assert len(value.data) == value.height * value.step
        assert value.timestamp.sec * 10**9 + value.timestamp.nanosec == message.log_time
        brightest = max(brightest, max(value.data))
    assert brightest == 255


@pytest.mark.slow
def test_the_brightest_cell_is_the_one_that_is_pressed_hardest(recording):
    trial, _, pictures = recording
    left = [value for topic, _, _, value in decoded(pictures) if topic.endswith("pads_left")]
    rise = trial.trace.pad_left - trial.trace.pad_left[0]
    brightest = int(np.argmax(rise[:, 7:].max(axis=1)))
    picture = np.frombuffer(bytes(left[brightest].data), np.uint8).reshape(
        left[brightest].height, left[brightest].width
    )
    cells = picture[CELL_PIXELS // 2 :: CELL_PIXELS, CELL_PIXELS // 2 :: CELL_PIXELS]
    assert np.argmax(cells) == np.argmax(rise[brightest, 7:])


def test_a_recording_with_pictures_is_read_like_the_recording(recording, tmp_path):
    _, path, pictures = recording
    write_mcap(tmp_path / "copy.mcap", read_recorded(path))
    recorded, now = read_recorded(tmp_path / "copy.mcap"), read_recorded(pictures)
    assert repr(now.readings()) == repr(recorded.readings())
    assert now.metadata == recorded.metadata
    assert now.ticks.tobytes() == recorded.ticks.tobytes()


def test_without_tactile_images_there_is_nothing_to_draw(tmp_path):
    write_recording(tmp_path / "g.mcap", ticks=0)
    with pytest.raises(ConfigError, match=r"g\.mcap "):
        write_pictures(tmp_path / "p.mcap", read_recorded(tmp_path / "g.mcap"))


def test_cells_are_drawn_by_row_and_column_or_by_position():
    grid = _grid_of(TactileArray("palm", "N", rows=2, columns=3))
    assert (grid.rows.tolist(), grid.columns.tolist()) == ([0, 0, 0, 1, 1, 1], [0, 1, 2, 0, 1, 2])
    places = ((0.01, 0.0), (float("nan"), float("nan")), (0.02, -0.005), (0.01, 0.005))
    grid = _grid_of(TactileArray("palm", "N", positions_m=places))
    # The far end of the finger, the largest first coordinate, is at the top.
    assert grid.cells.tolist() == [0, 2, 3]
    assert (grid.rows.tolist(), grid.columns.tolist()) == ([1, 0, 1], [1, 0, 2])
