#!/usr/bin/env bash
# Runs a command that fetches something, again after a pause where it fails: registries are busy now and then.
set -u
for pause in 5 20; do
  "$@" && exit
  echo "it is tried again in $pause s: $*" >&2
  sleep "$pause"
done
exec "$@"
