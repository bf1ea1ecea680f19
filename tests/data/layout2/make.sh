#!/usr/bin/env bash
# Makes the store and the exports in this folder anew: `make.sh GRASPSENSE FOLDER`, with the program of the version that
# is to be kept readable. Those here were made by version 3ae4ed3, the last one before channels were declared.
set -euo pipefail
graspsense=$1 out=$2
mkdir -p "$out"
cd "$out"
"$graspsense" run --seed 1 --object can:full_open --label can:full_open --save store \
    -o controller.probing_force_n=12 -o run.hold_s=0.05 >/dev/null
"$graspsense" run --seed 3 --gripper pr2 -o gripper.transport=emulated -o gripper.object=can:full_open \
    --label can:full_open --save store --changed -o run.hold_s=0.05 >/dev/null
"$graspsense" export store --to features.csv >/dev/null
"$graspsense" export 'store#1' --to grasp.npz >/dev/null
