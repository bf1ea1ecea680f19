"""A router of zenoh in this process, as rmw_zenohd is one."""

import json
import socket

import zenoh


def free_port():
    with socket.socket() as server:
        server.bind(("127.0.0.1", 0))
        return server.getsockname()[1]


def opened_router(port=None):
    """Return the port of a new router on loopback, and the router, which lives as long as it is held."""
    port = port or free_port()
    config = zenoh.Config()
    for key, value in {
        "mode": "router",
        "listen/endpoints": [f"tcp/127.0.0.1:{port}"],
        "scouting/multicast/enabled": False,
    }.items():
        config.insert_json5(key, json.dumps(value))
    return port, zenoh.open(config)
