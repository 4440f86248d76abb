#!/usr/bin/env bash
# How many tests were left out, and why:  bash tests/left_out.sh NOTED
# Each line of NOTED is `file::name`, a tab and the reason. What several processes have noted counts once.
set -euo pipefail
export LC_ALL=C
noted=$(sort -u "$1")
if [ -z "$noted" ]; then echo "0 tests left out"; exit; fi
reasons=$(cut -f 2- <<< "$noted" | sort | uniq -c | sort -k 1,1rn -k 2 |
  awk '{ sub(/^ */, ""); printf "%s%s", between, $0; between = "; " }')
count=$(wc -l <<< "$noted")
tests=tests
if [ "$count" = 1 ]; then tests=test; fi
echo "$count $tests left out: $reasons"
