#!/usr/bin/env bash
# Names all that tests/run.sh cannot do without and this machine does not have, with the package of Debian that has it. What only
# some tests need, which are left out without it, is not among it.
set -uo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
missing=()

need() {  # TOOL PACKAGE
  # A word of the shell alone, as `kill` can be, is no program that others can call.
  type -P "$1" >/dev/null || missing+=("$1 (apt-get install $2)")
}

command -v cargo >/dev/null || missing+=("cargo (https://rustup.rs)")
need cc gcc
need c++ g++
need make make
need flock util-linux
need unshare util-linux
need nsenter util-linux
need kill procps

if python=$(bash "$here/python311.sh" 2>/dev/null); then
  "$python" -c 'import ensurepip, venv' 2>/dev/null || missing+=("venv of $python (apt-get install python3.11-venv)")
  include=$("$python" -c 'import sysconfig; print(sysconfig.get_path("include"))')
  [ -e "$include/Python.h" ] || missing+=("$include/Python.h (apt-get install python3.11-dev)")
else
  missing+=("python3.11 with venv and Python.h (apt-get install python3.11 python3.11-venv python3.11-dev; where there is none: uv python install 3.11)")
fi

# OpenSSL is built from source where there is none to build against. Debian's perl-base, which is always there, is too little.
if [ -z "${OPENSSL_NO_VENDOR:-}" ] && ! pkg-config --atleast-version=1.1.1 openssl 2>/dev/null; then
  perl -MFindBin -MIPC::Cmd -e 1 2>/dev/null ||
    missing+=("OpenSSL (apt-get install pkg-config libssl-dev), or perl to build it with (apt-get install perl)")
fi

if command -v unshare >/dev/null; then
  refusal=$(bash "$here/namespaces.sh" 2>&1) || missing+=("$refusal")
fi

if [ "${#missing[@]}" = 0 ]; then exit; fi
{ echo "this machine lacks:"; printf -- '- %s\n' "${missing[@]}"; } >&2
exit 1
