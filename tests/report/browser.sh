#!/usr/bin/env bash
# Sees to it that Debian's Chromium is there. Where it cannot be installed, the tests that need it say they were left out.
set -uo pipefail
if [ -x /usr/bin/chromium ] && [ -x /usr/bin/chromedriver ]; then exit 0; fi
if [ "$(id -u)" != 0 ] || ! command -v apt-get >/dev/null; then
  echo "no chromium, and it cannot be installed from here: apt-get install chromium chromium-driver"
  exit 0
fi
log=$(mktemp)
export DEBIAN_FRONTEND=noninteractive
if { apt-get update -q && apt-get install -qy --no-install-recommends chromium chromium-driver; } >"$log" 2>&1; then
  echo "chromium is installed"
else
  tail -n 5 "$log"
  echo "chromium could not be installed"
fi
rm -f "$log"
