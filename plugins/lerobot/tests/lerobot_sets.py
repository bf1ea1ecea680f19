"""Small LeRobot data sets of both versions, written with pyarrow as LeRobot's documentation describes them."""

import json

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

FPS = 30
CELLS = [f"f{finger}.p{cell:02d}.f{axis}" for finger in range(2) for cell in range(4) for axis in "xyz"]
NAMES = ["shoulder.pos", "gripper.pos", "gripper.load", *CELLS]


def episode(squeezes=1, frames=90, peak=4.0):
    """Return the observations of an episode: a gripper in percent that closes and opens this often, two fingertips."""
    parts = []
    for k in range(squeezes):
        t = np.linspace(0.0, 1.0, frames)
        closed = np.clip(3.0 * t, 0.0, 1.0) - np.clip(3.0 * t - 2.0, 0.0, 1.0)
        held = np.clip(closed - 0.6, 0.0, None) / 0.4
        gap = 100.0 - 70.0 * np.minimum(closed, 0.8)
        cells = np.zeros((frames, 2, 4, 3))
        cells[..., 2] = (peak + 0.25 * k) * held[:, None, None] * np.array([1.0, 2.0, 2.0, 1.0])
        cells[..., 0] = 0.1 * cells[..., 2]
        wobble = 0.01 * np.sin(np.arange(frames))
        parts.append(np.column_stack([wobble, gap + wobble, 50.0 * held, cells.reshape(frames, -1)]))
    return np.concatenate(parts)


def features(names, version):
    scalar = {
        "timestamp": "float32", "frame_index": "int64", "episode_index": "int64", "index": "int64",
        "task_index": "int64",
    }  # fmt: skip
    return {
        "observation.state": {
            "dtype": "float32",
            "shape": [len(names)],
            "names": list(names) if version == 3 else {"motors": list(names)},
        },
        "action": {"dtype": "float32", "shape": [1], "names": ["gripper.pos"]},
        "observation.images.wrist": {
            "dtype": "video", "shape": [64, 64, 3], "names": ["height", "width", "channels"],
        },
        **{name: {"dtype": dtype, "shape": [1], "names": None} for name, dtype in scalar.items()},
    }  # fmt: skip


def table(states, numbers, tasks, start):
    lengths = [len(state) for state in states]
    state = np.concatenate(states).astype(np.float32)
    frame = np.concatenate([np.arange(n) for n in lengths])
    return pa.table(
        {
            "observation.state": pa.array(list(state), pa.list_(pa.float32())),
            "action": pa.array(state[:, 1]),
            "timestamp": pa.array((frame / FPS).astype(np.float32)),
            "frame_index": pa.array(frame),
            "episode_index": pa.array(np.repeat(numbers, lengths)),
            "index": pa.array(start + np.arange(len(frame))),
            "task_index": pa.array(np.repeat(tasks, lengths)),
        }
    )


def info(version, states, names, changed):
    paths = {
        2: (
            "data/chunk-{episode_chunk:03d}/episode_{episode_index:06d}.parquet",
            "videos/chunk-{episode_chunk:03d}/{video_key}/episode_{episode_index:06d}.mp4",
        ),
        3: (
            "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet",
            "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4",
        ),
    }
    return {
        "codebase_version": "v2.1" if version == 2 else "v3.0",
        "robot_type": "so101",
        "total_episodes": len(states),
        "total_frames": sum(map(len, states)),
        "total_tasks": 2,
        "chunks_size": 1000,
        "fps": FPS,
        "splits": {"train": f"0:{len(states)}"},
        "data_path": paths[version][0],
        "video_path": paths[version][1],
        "features": features(names, version),
        **changed,
    }


def write_set(folder, version, states=None, names=NAMES, **changed):
    """Write a data set of these episodes, whose tasks alternate; `changed` are keys of `meta/info.json`."""
    states = [episode(), episode(2, peak=3.0), episode(peak=5.0)] if states is None else states
    tasks = ["pick the red cup", "squeeze: sponge"]
    lengths = [len(state) for state in states]
    starts = np.concatenate([[0], np.cumsum(lengths)])
    (folder / "meta").mkdir(parents=True)
    (folder / "meta/info.json").write_text(json.dumps(info(version, states, names, changed)))
    if version == 2:
        write_lines(
            folder / "meta/tasks.jsonl", [{"task_index": k, "task": task} for k, task in enumerate(tasks)]
        )
        rows = [{"episode_index": k, "tasks": [tasks[k % 2]], "length": n} for k, n in enumerate(lengths)]
        write_lines(folder / "meta/episodes.jsonl", rows)
        (folder / "data/chunk-000").mkdir(parents=True)
        for k, state in enumerate(states):
            part = table([state], [k], [k % 2], int(starts[k]))
            pq.write_table(part, folder / f"data/chunk-000/episode_{k:06d}.parquet")
        return folder
    pq.write_table(
        pa.table({"task_index": list(range(len(tasks))), "__index_level_0__": tasks}),
        folder / "meta/tasks.parquet",
    )
    (folder / "meta/episodes/chunk-000").mkdir(parents=True)
    n = len(states)
    episodes = {
        "episode_index": list(range(n)),
        "tasks": [[tasks[k % 2]] for k in range(n)],
        "length": lengths,
        "dataset_from_index": starts[:-1].tolist(),
        "dataset_to_index": starts[1:].tolist(),
        "data/chunk_index": [0] * n,
        "data/file_index": [0] * n,
        "videos/observation.images.wrist/chunk_index": [0] * n,
        "videos/observation.images.wrist/file_index": [0] * n,
        "videos/observation.images.wrist/from_timestamp": (starts[:-1] / FPS).tolist(),
        "videos/observation.images.wrist/to_timestamp": (starts[1:] / FPS).tolist(),
    }
    pq.write_table(pa.table(episodes), folder / "meta/episodes/chunk-000/file-000.parquet")
    (folder / "data/chunk-000").mkdir(parents=True)
    whole = table(states, range(n), [k % 2 for k in range(n)], 0)
    pq.write_table(whole, folder / "data/chunk-000/file-000.parquet")
    return folder


def write_lines(path, rows):
    path.write_text("".join(json.dumps(row) + "\n" for row in rows))
