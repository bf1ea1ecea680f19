"""The UR cap's side of its socket, over an emulated gripper."""

from __future__ import annotations

from graspsense_robotiq_2f.emulator.hand import Hand
from graspsense_robotiq_2f.registers import COUNT, INPUT, OUTPUT, Request, request_of, status_of
from graspsense_robotiq_2f.ur_cap import ACKNOWLEDGED, variables

REFUSED = "?"


def answered(hand: Hand, data: bytes, now_s: float) -> tuple[bytes, bytes]:
    """Return the replies to the lines in the data, and what remains of it."""
    *lines, remaining = data.split(b"\n")
    return b"".join(_reply(hand, line.decode(errors="replace"), now_s).encode() for line in lines), remaining


def _reply(hand: Hand, line: str, now_s: float) -> str:
    verb, *words = line.split() or [""]
    asked = variables(request_of(hand.registers))
    if verb == "GET" and len(words) == 1:
        status = status_of(hand.read(INPUT, COUNT, now_s))
        known = {"STA": status.state, "OBJ": status.objects, "FLT": status.fault, "POS": status.position}
        return f"{words[0]} {({**asked, 'PRE': asked['POS'], **known}).get(words[0], REFUSED)}\n"
    given = dict(zip(words[::2], words[1::2], strict=False))
    if verb != "SET" or len(words) % 2 or not given.keys() <= asked.keys():
        return REFUSED
    if not all(value.isdecimal() and int(value) <= 255 for value in given.values()):
        return REFUSED
    wanted = asked | {name: int(value) for name, value in given.items()}
    request = Request(
        active=bool(wanted["ACT"]),
        go=bool(wanted["GTO"]),
        position=wanted["POS"],
        speed=wanted["SPE"],
        force=wanted["FOR"],
    )
    hand.write(OUTPUT, request.registers(), now_s)
    return ACKNOWLEDGED
