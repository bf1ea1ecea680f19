"""franky-sim, an independent emulation of the network protocol, with a thing of 30 mm between its fingers.

python franky.py HOST serves it at this address until it is ended, and prints a line once it can be reached.
"""

import sys

import franky_sim
from franky_sim.mujoco_simulator import MujocoSimulator

THING_M = 0.03

with MujocoSimulator(enable_visualization=False) as simulator:
    robot = simulator.add_robot()
    went = robot.set_hand_goal
    # The fingers cannot go where the thing is.
    robot.set_hand_goal = lambda width_m, speed, force_n: went(max(width_m, THING_M), speed, force_n)
    with franky_sim.SimulationServer(simulator, hostname_candidates=[sys.argv[1]]) as server:
        sys.stdout.write("ready\n")
        sys.stdout.flush()
        server.run_forever()
