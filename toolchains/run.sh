#!/usr/bin/env bash
# Installs what is missing, builds the PC programs and lets the radar track the four vehicles of Lee and Kim 2000.
# Options are passed on to radar_sim: toolchains/run.sh --scenario highway --seed 7
set -euo pipefail
cd "$(dirname "$0")/.."
. toolchains/packages.sh
install_packages $HOST_PACKAGES

cmake --preset host >/dev/null
cmake --build --preset host -j "$(nproc)" --target radar_sim radar_monitor

mkdir -p out
case " $* " in
    *" --scenario"* | *" --replay"* | *" --traffic"* | *" --detections"* | *" --list-scenarios"* | *" --help"*) ;;
    *) set -- --scenario four-targets "$@" ;;
esac
build/host/host_sim/radar_sim --log out/can.log --json out/summary.json --plot out "$@"
