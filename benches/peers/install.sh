# Sourced by run.sh: what the peers need, made once and kept in $cache. What cannot be had becomes a line in $results.
# Uses: here, cache, results, log, missing.
# shellcheck shell=bash disable=SC2154

pcl=1.13   # Debian 12's

as_root() {
  if [ "$(id -u)" = 0 ]; then "$@"
  elif command -v sudo >/dev/null; then sudo "$@"
  else echo "this is not root and there is no sudo for: $*" >&2; return 1
  fi
}

apt() { as_root env DEBIAN_FRONTEND=noninteractive apt-get -q -o DPkg::Lock::Timeout=300 "$@"; }

updated=
update_lists() { [ -n "$updated" ] || apt update || true; updated=yes; }

# Installs those that are absent. Where that fails, PEER goes without.
packages() {  # PEER PACKAGE...
  local peer=$1 name absent=()
  shift
  for name; do
    [ "$(dpkg-query -W -f '${db:Status-Status}' "$name" 2>/dev/null)" = installed ] || absent+=("$name")
  done
  [ ${#absent[@]} != 0 ] || return 0
  echo "installing ${absent[*]}" >&2
  # Where the lists cannot be had, the old ones may do.
  { update_lists; apt install -y --no-install-recommends "${absent[@]}"; } > "$log" 2>&1 ||
    { missing "$peer" "packages ${absent[*]}: $(tail -n 1 "$log")"; return 1; }
}

# The -dev packages bring VTK, Qt and MPI, 400 packages, for what is but headers here: those are unpacked in $cache.
pcl_headers() {
  local headers=$cache/headers
  if [ -e "$headers/usr/include/pcl-$pcl" ] && [ -e "$headers/usr/include/flann" ]; then return; fi
  rm -rf "$headers" "$headers.part"
  mkdir -p "$headers.part"
  if unpack "$headers.part" libpcl-dev libflann-dev > "$log" 2>&1; then mv "$headers.part" "$headers"
  else missing PCL "headers: $(tail -n 1 "$log")"; return 1
  fi
}

unpack() (  # FOLDER PACKAGE...
  cd "$1" || exit
  shift
  apt-get -q download "$@" || { update_lists; apt-get -q download "$@"; } || exit
  for deb in ./*.deb; do dpkg -x "$deb" . && rm "$deb" || exit; done
)

# -march=native: a program is for this processor alone, so the folder's name follows from that. NDEBUG, as in ours.
programs() {
  command -v g++ >/dev/null || packages PCL g++ || { missing OctoMap "there is no g++ either"; return 0; }
  local native key
  native=$(g++ -march=native -Q --help=target)
  key=$({ echo "$native"; g++ --version; cat "$here"/{install.sh,*.cpp,*.hpp}; } | sha256sum | cut -c 1-16)
  bin=$cache/programs-$key
  mkdir -p "$bin"
  if packages OctoMap liboctomap-dev; then compile OctoMap octomap -loctomap -loctomath; fi
  # Without the limit Eigen would align to 64 bytes in this program and to 16 in libpcl_common.
  if packages PCL "libpcl-common$pcl" libeigen3-dev libboost-dev liblz4-dev && pcl_headers; then
    compile PCL pcl -DPCL_NO_PRECOMPILE -DEIGEN_MAX_ALIGN_BYTES=16 -isystem /usr/include/eigen3 \
      -isystem "$cache/headers/usr/include/pcl-$pcl" -isystem "$cache/headers/usr/include" \
      "-l:libpcl_common.so.$pcl" -llz4
  fi
}

compile() {  # PEER SOURCE OPTION...
  local peer=$1 source=$2
  shift 2
  [ ! -e "$bin/$source" ] || return 0
  echo "compiling $source.cpp" >&2
  if g++ -std=c++17 -O3 -march=native -DNDEBUG "$here/$source.cpp" -o "$bin/$source.part" "$@" > "$log" 2>&1
  then mv "$bin/$source.part" "$bin/$source"
  else missing "$peer" "does not compile: $(grep -m 1 -E 'error|cannot find' "$log" || tail -n 1 "$log")"
  fi
}

# What wheels do not bring. A peer that still lacks something says so when it is run.
libraries() {
  "$python" -c 'import open3d' 2>/dev/null || packages Open3D libgl1 libgomp1 libusb-1.0-0 || true
  command -v java >/dev/null || packages "MOA in capymoa" default-jre-headless || true
}

# Sets `python`. The folder's name follows from the interpreter and the pins; one that lacks a pin is made anew.
environment() {
  local found='' candidate key pin
  for candidate in python3.11 python3; do
    if "$candidate" -c 'import sys; sys.exit(sys.version_info[:2] != (3, 11))' 2>/dev/null
    then found=$candidate; break
    fi
  done
  [ -n "$found" ] || die "needs CPython 3.11 (the pins are for it): no python3.11 here"
  found=$("$found" -c 'import sys; print(sys.executable)')
  "$found" -c 'import ensurepip' 2>/dev/null || packages Python python3.11-venv || die "$found has no ensurepip"
  key=$({ echo "$found"; sha256sum < "$here/requirements.txt"; } | sha256sum | cut -c 1-16)
  local venv=$cache/venv-$key whole=yes
  python=$venv/bin/python
  if [ -e "$venv/complete" ]; then return; fi
  echo "installing the peers in Python into $venv" >&2
  rm -rf "$venv"
  "$found" -m venv "$venv" > "$log" 2>&1 || die "$found cannot make a virtual environment: $(tail -n 1 "$log")"
  if ! install_pins -r "$here/requirements.txt"; then   # then as many as can be had
    while read -r pin; do
      install_pins "$pin" || { missing "$pin" "$(grep -m 1 ERROR "$log" || tail -n 1 "$log")"; whole=; }
    done < <(grep -E '^[A-Za-z]' "$here/requirements.txt")
  fi
  [ -z "$whole" ] || touch "$venv/complete"
}

install_pins() { "$python" -m pip install -q --disable-pip-version-check --no-deps "$@" > "$log" 2>&1; }
