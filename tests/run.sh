#!/usr/bin/env bash
# All that the project checks, in one command:  bash tests/run.sh
# Recordings come from CFODI_DATA, the tool that makes bags of them from CFODI_TOOLS (default: ../shared/data and
# ../shared/tools beside the repository); tests that need them are left out without them, and the last line says how many.
#
# No release is built: that takes ten minutes more. Tests of a release, or single ones: with CFODI_BIN=target/release/cfodi, or
# target/tested/cfodi, which is made here.
set -euo pipefail
top=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
CFODI_DATA=$(realpath -m "${CFODI_DATA:-$top/../shared/data}")
target=$(realpath -m "${CARGO_TARGET_DIR:-$top/target}")
export CARGO_TARGET_DIR=$target
CFODI_BIN=$(realpath -m "${CFODI_BIN:-$target/tested/cfodi}")
CFODI_TOOLS=$(realpath -m "${CFODI_TOOLS:-$top/../shared/tools}")
CFODI_SECURED=$(realpath -m "${CFODI_SECURED:-$target/secured}")
CFODI_DEBUG_BIN=$CFODI_SECURED/cfodi
export CFODI_DATA CFODI_TOOLS CFODI_BIN CFODI_SECURED CFODI_DEBUG_BIN
cd "$top"
bash tests/needs.sh
CFODI_LEFT_OUT=$(mktemp) soaked=$(mktemp) preparing=$(mktemp)
export CFODI_LEFT_OUT
current=start
rmem=/proc/sys/net/core/rmem_max wanted=33554432 before=
prepared= soaking=
default=/proc/sys/net/core/rmem_default readers=8388608 default_before=

closing() {
  local status=$?
  # With all that it has started.
  [ -z "$prepared" ] || kill -- "-$prepared" 2>/dev/null || true
  [ -z "$soaking" ] || kill "$soaking" 2>/dev/null || true
  [ -z "$before" ] || echo "$before" > "$rmem" || echo "net.core.rmem_max could not be put back to $before" >&2
  [ -z "$default_before" ] || echo "$default_before" > "$default" ||
    echo "net.core.rmem_default could not be put back to $default_before" >&2
  [ "$status" = 0 ] || echo "FAILED: $current" >&2
  echo "recordings: $CFODI_DATA, tools: $CFODI_TOOLS; CFODI_DATA and CFODI_TOOLS name others"
  bash tests/left_out.sh "$CFODI_LEFT_OUT"
  rm -f "$CFODI_LEFT_OUT" "$soaked" "$preparing"
  exit "$status"
}
trap closing EXIT
trap 'exit 129' HUP
trap 'exit 130' INT
trap 'exit 143' TERM

step() { current=$1; echo "== $1"; }

run() { step "$*"; "$@"; }

# A minimal toolchain has no rustfmt and no clippy. Where nobody looks on, that is a failure.
optional() {  # TOOL COMMAND...
  local tool=$1; shift
  if cargo "$tool" --version >/dev/null 2>&1; then run "$@"
  elif [ "${CI:-}" = true ]; then step "$*"; echo "cargo $tool is not installed" >&2; exit 1
  else echo "== left out, cargo $tool is not installed: $*"
  fi
}

# The ROS tests send clouds of 10 MB. The buffer that this takes can be set only outside of their network namespace.
raise_socket_buffer() {
  local now
  now=$(cat "$rmem" 2>/dev/null || echo 0)
  if [ "$now" -ge "$wanted" ]; then return; fi
  if { echo "$wanted" > "$rmem"; } 2>/dev/null; then
    before=$now
    echo "net.core.rmem_max: $now, raised to $wanted until the end of this run"
  else
    echo "net.core.rmem_max is $now and cannot be raised from here; the tests with large clouds will fail." \
      "Set it with: sudo sysctl -w net.core.rmem_max=$wanted"
  fi
}

# The tests' own build has the features `security` and `zenoh`: their ROS tests, which ask whether they are right, not how fast,
# need no build of their own. Into CFODI_SECURED, since the next `cargo build` would write over it.
keep_secured() {
  mkdir -p "$CFODI_SECURED"
  # A program that somebody runs cannot be written to, but replaced.
  cp --remove-destination "$target/debug/cfodi" "$target/debug/examples/"{clusters,robot} "$CFODI_SECURED"
}

# Without these features, as most users build it: our own code as in a release, and of the crates those that the tests' build has
# already, which saves a sixth of the time that all of this takes. Into tested/.
build_tested() {
  local own=(opt-level=3 codegen-units=16 debug-assertions=false overflow-checks=false)
  local build=(cargo build --color never --bin cfodi "${own[@]/#/--config=profile.dev.package.cfodi.}")
  mkdir -p "$target/tested"
  step "${build[*]}"
  CARGO_INCREMENTAL=0 "${build[@]}" 2>&1 | tee "$target/tested/log"
  # Lines for builds without a feature are compiled here alone. `-D warnings` as RUSTFLAGS would have all crates made anew.
  if grep -q '^warning: `cfodi`' "$target/tested/log"; then echo "warnings are errors" >&2; exit 1; fi
  cp --remove-destination "$target/debug/cfodi" "$target/tested"
}

# The readers of the tests have what is the default: on a stock kernel's 208 KiB, best-effort points of half a megabyte are lost
# now and then, which is their reader's loss and no test of ours.
raise_readers_buffer() {
  local now
  now=$(cat "$default" 2>/dev/null || echo "$readers")
  if [ "$now" -lt "$readers" ] && { echo "$readers" > "$default"; } 2>/dev/null; then default_before=$now; fi
}

# On one core, a minute long: beside what leaves it one. What it says is told at its end.
begin_soak() {
  "$target/debug/examples/soak" --hours 0.015 --views 30 >"$soaked" 2>&1 &
  soaking=$!
}

end_soak() {
  local status=0
  step "$target/debug/examples/soak --hours 0.015 --views 30"
  wait "$soaking" || status=$?
  soaking=
  cat "$soaked"
  return "$status"
}

# What the later tests run on is fetched while crates are compiled. Who needs it waits for it, and makes what failed here again.
prepare() {
  local status=0
  for make in tests/ros/env.sh tests/bags/env.sh "tests/bags/env.sh tests/colcon" tests/report/browser.sh; do
    # shellcheck disable=SC2086
    bash $make || { status=1; echo "FAILED: $make"; }
  done >"$preparing" 2>&1
  return "$status"
}

# The same random cases on every machine, so that what passes on one passes on the next.
export PROPTEST_RNG_SEED=${PROPTEST_RNG_SEED:-1}
# The system's OpenSSL, where it can be built against, saves minutes.
if pkg-config --atleast-version=1.1.1 openssl 2>/dev/null; then export OPENSSL_NO_VENDOR=1; fi
optional fmt cargo fmt --check
# In a group of its own, as the shell gives it where jobs are controlled.
set -m
prepare </dev/null &
prepared=$!
set +m
run bash tests/deny.sh
# All that is compiled only when asked for, and with it all that is by default: `humble` stands for `jazzy`. The same features for
# both, so that the crates are looked at once.
most=(--no-default-features --features "node,humble,security,zenoh")
optional clippy cargo clippy --all-targets "${most[@]}" -- -D warnings
RUSTDOCFLAGS="-D warnings" run cargo doc --no-deps "${most[@]}"
# The wall around the engine.
if cargo clippy --version >/dev/null 2>&1; then run cargo clippy --lib --no-default-features -- -D warnings
else run cargo check --lib --no-default-features
fi
# As `benches/peers` builds it.
run cargo check --lib --no-default-features --features sim
all=(--features "security,zenoh")
if cargo nextest --version >/dev/null 2>&1; then
  run cargo nextest run "${all[@]}" --no-fail-fast
else
  run cargo test "${all[@]}" --lib --bins --tests --no-fail-fast
fi
run cargo build "${all[@]}" --bin cfodi --examples   # the tests have built the same
keep_secured
run cargo test "${all[@]}" --doc
begin_soak
run cargo bench "${all[@]}" --profile test --bench '*' -- --test   # each benchmark once: that it runs, not how fast
end_soak
build_tested
wait "$prepared" || { echo "not all that the next tests run on could be fetched; it is tried again:"; cat "$preparing"; } >&2
prepared=
step "ROS tests: sockets"
raise_socket_buffer
raise_readers_buffer
run bash tests/ros/python.sh -m pytest tests/ros -m alone
run bash tests/ros/python.sh -m pytest tests/ros -m "not alone" --numprocesses 8 --dist loadscope   # they mostly wait
run bash tests/colcon/python.sh -m pytest tests/colcon
step "report: a browser"
bash tests/report/browser.sh
run bash tests/bags/python.sh -m pytest -c tests/bags/pytest.ini tests/bags tests/report --numprocesses 2 --dist loadfile
current=
