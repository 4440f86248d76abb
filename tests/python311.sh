#!/usr/bin/env bash
# Prints the path of a CPython 3.11; fails where there is none.
set -euo pipefail
for candidate in python3.11 python3; do
  if "$candidate" -c 'import sys; sys.exit(sys.version_info[:2] != (3, 11))' 2>/dev/null; then
    exec "$candidate" -c 'import sys; print(sys.executable)'
  fi
done
echo "no CPython 3.11 here, for which the tests' packages are built (Debian 12: apt-get install python3.11; elsewhere: uv python install 3.11)" >&2
exit 1
