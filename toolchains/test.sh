#!/usr/bin/env bash
# Installs what is missing, builds every configuration for PC and boards, checks the format, runs every test.
set -euo pipefail
cd "$(dirname "$0")/.."
. toolchains/packages.sh
install_packages $HOST_PACKAGES $TEST_PACKAGES $BOARD_PACKAGES $VCAN_PACKAGES

jobs=$(nproc)
boards="zcu102-r5 mps2-an500 mps2-an386"
total_passed=0 total_failed=0 total_skipped=0

# run_tests PRESET [ctest option...]: goes on after a failure; the sum of all presets is printed at the end.
run_tests() {
    local preset=$1 log of failed skipped
    shift
    log=$(mktemp)
    echo "== ctest --preset $preset $*"
    ctest --preset "$preset" "$@" 2>&1 | tee "$log" || true
    of=$(sed -nE 's/.*tests passed, ([0-9]+) tests failed out of ([0-9]+).*/\2/p' "$log" | tail -1)
    failed=$(sed -nE 's/.*tests passed, ([0-9]+) tests failed out of ([0-9]+).*/\1/p' "$log" | tail -1)
    skipped=$(grep -cE '\*\*\*Skipped' "$log" || true)
    rm -f "$log"
    if [ -z "$of" ]; then
        echo "ctest --preset $preset printed no summary" >&2
        of=1 failed=1 skipped=0
    fi
    total_failed=$((total_failed + failed))
    total_skipped=$((total_skipped + skipped))
    total_passed=$((total_passed + of - failed - skipped))
}

build() {
    echo "== build $*"
    cmake --preset "$1" >/dev/null
    cmake --build --preset "$@" -j "$jobs"
}
build host
for board in $boards; do build "$board"; done
build host-debug
build host-clang --target radar_sim dsp_detect_test

echo "== format"
cmake --build --preset host --target format-check

run_tests host -j "$jobs" -LE vcan
run_tests host-clang -L bit-exact
run_tests host-debug -j "$jobs"
for board in $boards; do run_tests "$board" -j "$jobs"; done
run_tests host -j "$jobs" -L vcan

echo "$total_passed passed, $total_failed failed, $total_skipped skipped"
[ "$total_failed" -eq 0 ]
