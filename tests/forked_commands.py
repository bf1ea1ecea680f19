"""Runs commands of graspsense in forked copies of one warm process, and harms them, for tests of kills and faults.

As a program it reads requests from its standard input, one line of JSON each, and answers each with a line. A copy
starts in milliseconds, so a random moment of its life lies in its work and not in its imports.
"""

from __future__ import annotations

import errno
import json
import os
import resource
import select
import signal
import subprocess
import sys
import time
from pathlib import Path

from attrs import frozen

CHANGES = ("os.rename", "os.link", "os.mkdir", "os.remove")


@frozen
class Done:
    """How a command ended: killed or with an exit code, after how many writes, and what it said."""

    killed: bool
    code: int
    seconds: float
    writes: int
    said: str


class Commands:
    """A warm process; `run` runs a command in a copy of it."""

    def __init__(self, *warm):
        self.process = subprocess.Popen(
            [sys.executable, "-P", __file__],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env={**os.environ, "PYTHONPATH": str(Path(__file__).parent), "OMP_NUM_THREADS": "1"},
        )
        for arguments in warm:
            assert self._ask(warm=[str(word) for word in arguments])["code"] == 0, arguments

    def run(self, *arguments, kill_after_s=None, longest_file=None, fail_at=None, folder=""):
        """Run a command: killed after so long, with a limit on files, or with an error at a write to `folder`."""
        return Done(
            **self._ask(
                arguments=[str(word) for word in arguments],
                kill_after_s=kill_after_s,
                longest_file=longest_file,
                fail_at=fail_at,
                folder=str(folder),
            )
        )

    def _ask(self, **request):
        self.process.stdin.write(json.dumps(request) + "\n")
        self.process.stdin.flush()
        line = self.process.stdout.readline()
        assert line, "the process of the commands has ended"
        return json.loads(line)

    def close(self):
        self.process.stdin.close()
        self.process.stdout.close()
        self.process.wait(60)


def main():
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    for line in sys.stdin:
        request = json.loads(line)
        answer = {"code": command(request["warm"])} if "warm" in request else in_a_copy(request)
        answers.write(json.dumps(answer) + "\n")
        answers.flush()


def command(arguments):
    """Run a command in this process and return its exit code."""
    from graspsense.cli.main import main as graspsense

    try:
        graspsense(arguments)
    except SystemExit as ended:
        return ended.code or 0
    return 0


def in_a_copy(request):
    # A pipe, which a limit on files does not concern.
    heard, said = os.pipe2(os.O_NONBLOCK)
    told = os.memfd_create("told")
    began = time.perf_counter()
    pid = os.fork()
    if pid == 0:
        copy(request, said, told)
    ended = os.pidfd_open(pid)
    if request["kill_after_s"] is not None and not select.select([ended], [], [], request["kill_after_s"])[0]:
        os.kill(pid, signal.SIGKILL)
    _, status = os.waitpid(pid, 0)
    seconds = time.perf_counter() - began
    os.close(said)
    os.lseek(told, 0, os.SEEK_SET)
    answer = {
        "killed": os.WIFSIGNALED(status),
        "code": os.waitstatus_to_exitcode(status),
        "seconds": seconds,
        "writes": int(os.read(told, 100) or b"0"),
        "said": read(heard).decode(errors="replace"),
    }
    for fd in (heard, told, ended):
        os.close(fd)
    return answer


def read(heard):
    """Return what is in the pipe; a process that a killed command has left holds an empty one open."""
    try:
        return os.read(heard, 1 << 16)
    except BlockingIOError:
        return b""


def copy(request, said, told):
    """Be the copy: run the command with its fault, and end."""
    code = 99
    try:
        os.dup2(said, 1)
        os.dup2(said, 2)
        os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
        if request["longest_file"] is not None:
            resource.setrlimit(resource.RLIMIT_FSIZE, (request["longest_file"],) * 2)
        fault = Fault(request["folder"], request["fail_at"]) if request["folder"] else None
        code = command(request["arguments"])
        if fault:
            os.pwrite(told, str(fault.writes).encode(), 0)
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)


class Fault:
    """An error of the disk at one write to the folder: to open a file, to write, sync, name or remove it."""

    def __init__(self, folder, fail_at):
        self.folder, self.fail_at, self.writes = folder, fail_at, 0
        self.write, self.fsync = os.write, os.fsync
        os.write, os.fsync = self.counted_write, self.counted_fsync
        sys.addaudithook(self.event)

    def counted_write(self, fd, data):
        self.count(os.readlink(f"/proc/self/fd/{fd}"))
        return self.write(fd, data)

    def counted_fsync(self, fd):
        self.count(os.readlink(f"/proc/self/fd/{fd}"))
        return self.fsync(fd)

    def event(self, name, arguments):
        writes = name == "open" and (arguments[2] or 0) & (os.O_WRONLY | os.O_RDWR | os.O_CREAT)
        if writes or name in CHANGES:
            self.count(arguments[0])

    def count(self, path):
        if str(path).startswith(self.folder):
            self.writes += 1
            if self.writes == self.fail_at:
                raise OSError(errno.EIO, os.strerror(errno.EIO), str(path))


if __name__ == "__main__":
    main()
