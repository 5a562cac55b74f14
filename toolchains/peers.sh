#!/usr/bin/env bash
# Fetches the source of KissFFT, of which Debian builds the float variant only, into build/peers/. After the next configure
# the benchmarks compare with its 16-bit variant too, on the PC and on the boards. Needs the network, not root.
set -euo pipefail
cd "$(dirname "$0")/.."
mkdir -p build/peers/lists/partial
cd build/peers
echo "deb-src [signed-by=/usr/share/keyrings/debian-archive-keyring.gpg] http://deb.debian.org/debian bookworm main" >sources.list
options=(-qq -o APT::Sandbox::User=root -o Dir::Etc::sourcelist="$PWD/sources.list" -o Dir::Etc::sourceparts=/dev/null -o Dir::State::lists="$PWD/lists")
apt-get "${options[@]}" update
apt-get "${options[@]}" source --download-only kissfft
tar xf kissfft_*.orig.tar.*
ls -d "$PWD"/kissfft-*
