#!/usr/bin/env bash
# Installs what is missing, builds every configuration, runs every test.
set -euo pipefail
cd "$(dirname "$0")/.."
. toolchains/packages.sh
install_packages $HOST_PACKAGES $TEST_PACKAGES

jobs=$(nproc)
total_passed=0 total_failed=0 total_skipped=0

# run_tests PRESET [ctest option...]: one summary for all presets at the end, whatever fails on the way.
run_tests() {
    local preset=$1 log
    shift
    log=$(mktemp)
    echo "== ctest --preset $preset"
    ctest --preset "$preset" -j "$jobs" "$@" 2>&1 | tee "$log" || true
    local of failed skipped
    of=$(sed -nE 's/.*tests? passed, ([0-9]+) tests? failed out of ([0-9]+).*/\2/p' "$log" | tail -1)
    failed=$(sed -nE 's/.*tests? passed, ([0-9]+) tests? failed out of ([0-9]+).*/\1/p' "$log" | tail -1)
    skipped=$(grep -cE '\*\*\*Skipped' "$log" || true)
    rm -f "$log"
    if [ -z "$of" ]; then
        echo "ctest --preset $preset printed no summary" >&2
        of=1 failed=1
    fi
    total_failed=$((total_failed + failed))
    total_skipped=$((total_skipped + skipped))
    total_passed=$((total_passed + of - failed - skipped))
}

for preset in host host-debug host-clang; do
    echo "== build $preset"
    cmake --preset "$preset" >/dev/null
    cmake --build --preset "$preset" -j "$jobs"
done
cmake --build --preset host --target format-check
cmake --build --preset host --target tidy

run_tests host
run_tests host-debug
run_tests host-clang -L bit-exact

echo "$total_passed passed, $total_failed failed, $total_skipped skipped"
[ "$total_failed" -eq 0 ]
