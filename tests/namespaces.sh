#!/usr/bin/env bash
# Fails where this machine refuses the network namespaces that tests run in, and says what allows them.
set -euo pipefail
if refusal=$(unshare -rn true 2>&1); then exit; fi
echo "the tests need network namespaces of their own and this machine refuses one: $refusal" >&2
echo "(allow user namespaces: sysctl -w kernel.unprivileged_userns_clone=1 on Debian," \
  "sysctl -w kernel.apparmor_restrict_unprivileged_userns=0 on Ubuntu from 24.04 on; or run as root)" >&2
exit 1
