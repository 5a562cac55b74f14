#!/usr/bin/env bash
# Runs the commands of README.md as a reader would, in the source folder.
#   ```sh        run here
#   ```sh vcan   needs vcan0: run by tests/vcan, only listed here
#   ```console   needs a board on the bench: shown, not run
# toolchains/test.sh itself is left out: it is what runs this.
# Usage: readme_test.sh SOURCE_DIR [KIND]     KIND: "sh" (default) or "sh vcan"
set -euo pipefail
cd "$1"
kind=${2:-sh}

commands=$(awk -v fence="\`\`\`$kind" '$0 == fence {on = 1; next} /^```/ {on = 0} on' README.md)
[ -n "$commands" ] || { echo "README.md has no \`\`\`$kind block" >&2; exit 1; }
# radar_study rightly refuses to go on with what an earlier version of it began.
[ "$kind" != sh ] || rm -rf out/lee2000
log=$(mktemp)
count=0
while IFS= read -r line; do
    [ -n "$line" ] || continue
    case "$line" in
        \#* | toolchains/test.sh*) continue ;;
    esac
    echo "\$ $line"
    # A command that fails, or that asks for input, is a defect of the README.
    timeout 240 bash -c "$line" </dev/null >"$log" 2>&1 || {
        cat "$log"
        echo "README.md: this command failed: $line" >&2
        exit 1
    }
    count=$((count + 1))
done <<<"$commands"
rm -f "$log"
echo "$count commands of README.md ran"
