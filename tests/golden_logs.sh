#!/usr/bin/env bash
# The CAN log of every shipped scenario, byte for byte the same whatever compiler and optimisation built radar_sim.
# Usage: golden_logs.sh RADAR_SIM           compare with tests/golden_logs.txt
#        golden_logs.sh RADAR_SIM update    write it anew, after a change that is meant to change the output
set -euo pipefail
sim=$1
golden=$(dirname "$0")/golden_logs.txt
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

for name in approach crossing cut-in empty four-targets highway interference over-capacity stop-and-go; do
    "$sim" --scenario "$name" --frames 120 --seed 1 --quiet --log "$work/log" --record "$work/frames" >/dev/null
    printf '%-14s beat frames %10s  CAN log %10s\n' "$name" "$(cksum <"$work/frames" | cut -d' ' -f1)" \
        "$(cksum <"$work/log" | cut -d' ' -f1)"
done >"$work/now"

if [ "${2:-}" = update ]; then
    cp "$work/now" "$golden"
else
    diff -u "$golden" "$work/now" && echo "$(wc -l <"$golden") logs as before"
fi
