#!/usr/bin/env bash
# tests/processors.sh [COMMAND]: docs/platforms.md promises the same bytes on every processor. Simulates, records and analyses here, on an
# x86 processor without wide vectors that qemu plays (PROCESSORS='Nehalem Haswell' adds one with them, which takes half an hour), and with COMMAND, another
# `roscausal`, if one is given. Ends with 'N passed, N failed'. Exit 77 when qemu cannot be had.
set -uo pipefail
cd "$(dirname "$0")/.."
. tests/lib.sh

if [ "$(uname -m)" = x86_64 ]; then
  command -v qemu-x86_64 >/dev/null || debian qemu-user
fi
prepare_only "$@"
cargo build "${workspace[@]}" --quiet --bin roscausal || broken "the command cannot be built"
roscausal=$(program roscausal)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# made FOLDER COMMAND...: what is promised, as files: runs with their batches, and models of the batches that were made here.
made() {
  local to=$1 how
  shift
  "$@" demo --scenario crowd --seed 3 --duration 20 --method pcmci --test parcorr --out "$to/crowd" -q --threads 1 >/dev/null &&
    "$@" demo --seed 3 --duration 45 --method pcmci --test parcorr --out "$to/demo" -q --threads 1 >/dev/null || return
  for how in "fpcmci --test gpdc" "pcmci --test robust_parcorr" "pcmciplus --test parcorr" "lpcmci --test parcorr" "pcmci --test cmiknn --shuffles 30" \
    granger varlingam dynotears timino; do
    # shellcheck disable=SC2086 # the method and its test are words
    "$@" discover "$work"/here/demo/pp_pool/analysed/*.csv --method $how --threads 1 --format json -q >"$to/${how// /}.json" || return
    sed -i 's/"run_time_s": *[0-9.e-]*/"run_time_s": null/' "$to/${how// /}.json"
  done
}

made "$work/here" "$roscausal" || broken "the command does not run"
passed=0 failed=0
same() { # where, then the command
  local where=$1
  shift
  if made "$work/$where" "$@" && diff -rq "$work/here" "$work/$where" -x '*.png' -x '*.pdf' -x .roscausal; then
    passed=$((passed + 1)) && echo "ok: the same bytes on $where"
  else
    failed=$((failed + 1)) && echo "FAIL: other bytes on $where" >&2
  fi
}
if [ "$(uname -m)" = x86_64 ]; then
  for processor in ${PROCESSORS-Nehalem}; do same "$processor" qemu-x86_64 -cpu "$processor" "$roscausal"; done
elif [ $# -eq 0 ]; then
  give_up "this is no x86 processor, and no other command is given to compare with"
fi
# shellcheck disable=SC2086 # the command is words
[ $# -eq 0 ] || same given $1
echo "$passed passed, $failed failed"
[ $failed -eq 0 ]
