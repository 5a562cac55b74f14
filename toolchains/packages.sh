# Debian packages by purpose, and how to install the missing ones. Sourced by run.sh and test.sh.
HOST_PACKAGES="g++ cmake ninja-build pkg-config libeigen3-dev libcli11-dev nlohmann-json3-dev libopenmpi-dev cpputest libbenchmark-dev libfftw3-dev libkissfft-dev gnuplot-nox fonts-dejavu-core"
TEST_PACKAGES="clang clang-format clang-tidy libclang-rt-14-dev openmpi-bin python3"
BOARD_PACKAGES="gcc-arm-none-eabi libnewlib-arm-none-eabi libstdc++-arm-none-eabi-newlib qemu-system-arm openocd"
VCAN_PACKAGES="qemu-system-x86 busybox-static cpio can-utils iproute2"

install_packages() {
    local missing=() p
    for p in "$@"; do
        dpkg-query -W -f='${Status}' "$p" 2>/dev/null | grep -q 'install ok installed' || missing+=("$p")
    done
    [ ${#missing[@]} -eq 0 ] && return
    echo "== installing ${missing[*]}"
    local sudo=""
    [ "$(id -u)" -eq 0 ] || sudo=sudo
    $sudo apt-get update -qq
    $sudo env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "${missing[@]}" >/dev/null
}
