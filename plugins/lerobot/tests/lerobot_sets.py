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
    def feature(dtype, shape, names=None):
        return {"dtype": dtype, "shape": shape, "names": names}

    listed = list(names) if version == 3 else {"motors": list(names)}
    return {
        "observation.state": feature("float32", [len(names)], listed),
        "action": feature("float32", [1], ["gripper.pos"]),
        "observation.images.wrist": feature("video", [64, 64, 3], ["height", "width", "channels"]),
        "timestamp": feature("float32", [1]),
        **{f"{name}index": feature("int64", [1]) for name in ("frame_", "episode_", "", "task_")},
    }


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
    chunk, file = "chunk-{chunk_index:03d}", "file-{file_index:03d}"
    data, video = f"data/{chunk}/{file}.parquet", f"videos/{{video_key}}/{chunk}/{file}.mp4"
    if version == 2:
        chunk, file = "chunk-{episode_chunk:03d}", "episode_{episode_index:06d}"
        data, video = f"data/{chunk}/{file}.parquet", f"videos/{chunk}/{{video_key}}/{file}.mp4"
    return {
        "codebase_version": "v2.1" if version == 2 else "v3.0",
        "robot_type": "so101",
        "total_episodes": len(states),
        "total_frames": sum(map(len, states)),
        "total_tasks": 2,
        "chunks_size": 1000,
        "fps": FPS,
        "splits": {"train": f"0:{len(states)}"},
        "data_path": data,
        "video_path": video,
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
        about = [{"task_index": k, "task": task} for k, task in enumerate(tasks)]
        write_lines(folder / "meta/tasks.jsonl", about)
        rows = [{"episode_index": k, "tasks": [tasks[k % 2]], "length": n} for k, n in enumerate(lengths)]
        write_lines(folder / "meta/episodes.jsonl", rows)
        (folder / "data/chunk-000").mkdir(parents=True)
        for k, state in enumerate(states):
            part = table([state], [k], [k % 2], int(starts[k]))
            pq.write_table(part, folder / f"data/chunk-000/episode_{k:06d}.parquet")
        return folder
    numbered = pa.table({"task_index": list(range(len(tasks))), "__index_level_0__": tasks})
    pq.write_table(numbered, folder / "meta/tasks.parquet")
    (folder / "meta/episodes/chunk-000").mkdir(parents=True)
    n, video = len(states), "videos/observation.images.wrist"
    places = [f"{part}/{index}_index" for part in ("data", video) for index in ("chunk", "file")]
    episodes = {
        "episode_index": list(range(n)),
        "tasks": [[tasks[k % 2]] for k in range(n)],
        "length": lengths,
        "dataset_from_index": starts[:-1].tolist(),
        "dataset_to_index": starts[1:].tolist(),
        **dict.fromkeys(places, [0] * n),
        f"{video}/from_timestamp": (starts[:-1] / FPS).tolist(),
        f"{video}/to_timestamp": (starts[1:] / FPS).tolist(),
    }
    pq.write_table(pa.table(episodes), folder / "meta/episodes/chunk-000/file-000.parquet")
    (folder / "data/chunk-000").mkdir(parents=True)
    whole = table(states, range(n), [k % 2 for k in range(n)], 0)
    pq.write_table(whole, folder / "data/chunk-000/file-000.parquet")
    return folder


def write_lines(path, rows):
    path.write_text("".join(json.dumps(row) + "\n" for row in rows))
