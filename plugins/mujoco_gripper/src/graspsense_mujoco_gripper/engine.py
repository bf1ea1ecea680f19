"""MuJoCo's functions and memory, as compiled code reaches them: by name in its library, and by address."""

from __future__ import annotations

import ctypes
from functools import cache
from pathlib import Path
from typing import Any, Final, NamedTuple

import mujoco
import numpy as np

NUMBERS: Final[dict[str, Any]] = {
    "int": ctypes.c_int,
    "mjtNum": ctypes.c_double,
    "mjtBool": ctypes.c_bool,
    "mjtSize": ctypes.c_int64,
    "size_t": ctypes.c_size_t,
    "uint64_t": ctypes.c_uint64,
    "uintptr_t": ctypes.c_size_t,
}


@cache
def structure(name: str) -> type[ctypes.Structure]:
    """Return the layout of a structure of MuJoCo, which its package declares."""
    # Not all that a single grasp needs.
    from mujoco.introspect.structs import STRUCTS

    fields = [(field.name, _type_of(field.type)) for field in STRUCTS[name].fields]
    return type(name, (ctypes.Structure,), {"_fields_": fields})


def _type_of(declared: Any) -> Any:
    if hasattr(declared, "extents"):
        element = _type_of(declared.inner_type)
        for extent in reversed(declared.extents):
            element *= extent
        return element
    name = getattr(declared, "name", "")
    # A pointer has no name.
    return NUMBERS.get(name) or (structure(name) if name else ctypes.c_void_p)


class Contacts(NamedTuple):
    """The contacts in the memory of a model; each step writes them anew, from the same place on."""

    count: Any
    """(1,)"""
    geoms: Any
    """(most, 2)"""
    frames: Any
    """(most, 9)"""
    used_bytes: Any
    """(1,) The most memory for contacts and solver that a step has taken."""


def contacts_of(data: mujoco.MjData) -> Contacts | None:
    """Return the contacts; None where the memory is not as MuJoCo's package declares it."""
    try:
        contact, layout = structure("mjContact"), structure("mjData")
    except (ImportError, KeyError):
        return None
    known: Any = layout.from_address(data._address)
    declared = known.narena, known.maxuse_arena, known.ncon, known.nefc, known.qpos
    if declared != (data.narena, data.maxuse_arena, data.ncon, data.nefc, data.qpos.ctypes.data):
        return None
    size = ctypes.sizeof(contact)
    most = data.narena // size
    whole = (ctypes.c_char * (most * size)).from_address(known.arena)

    def column(name: str, kind: type[np.generic], width: int) -> Any:
        start, strides = getattr(contact, name).offset, (size, np.dtype(kind).itemsize)
        return np.ndarray((most, width), kind, whole, start, strides)

    def number(name: str, kind: Any) -> Any:
        address = data._address + getattr(layout, name).offset
        return np.ctypeslib.as_array((kind * 1).from_address(address))

    return Contacts(
        number("ncon", ctypes.c_int),
        column("geom", np.int32, 2),
        column("frame", np.float64, 9),
        number("maxuse_arena", ctypes.c_int64),
    )


@cache
def functions() -> dict[str, Any]:
    """Return the functions of MuJoCo that compiled code calls. Raises ImportError without numba."""
    from llvmlite.binding import load_library_permanently
    from numba import types

    folder = Path(mujoco.__file__).parent
    # Python's module has loaded it already.
    (library,) = (path for path in folder.iterdir() if path.name.startswith(("libmujoco.", "mujoco.dll")))
    load_library_permanently(str(library))
    address, number = types.intp, types.float64
    return {
        "mj_step": types.ExternalFunction("mj_step", types.void(address, address)),
        "mj_contactForce": types.ExternalFunction(
            "mj_contactForce", types.void(address, address, types.int32, address)
        ),
        "mj_geomDistance": types.ExternalFunction(
            "mj_geomDistance", number(address, address, types.int32, types.int32, number, address)
        ),
    }
