#!/usr/bin/env bash
# All tests: Rust's own, then those against other software, format, lints and documentation. Installs what they need, and
# reports loudly what it cannot install. Exit code 0 only if nothing failed. Ends with the time of each part, what failed, the
# lines that said so, and the end of its output.
set -uo pipefail
cd "$(dirname "$0")/.."
. tests/lib.sh

kept=$(mktemp -d)
trap 'rm -rf "$kept"' EXIT
run() { # what, then the command; its output stays until the end
  local what=$1 begun=$SECONDS
  local log=$kept/${what//\//_}.log
  shift
  (
    "$@" 2>&1
    code=$?
    # the CPU time of what it has started: the second line, as 1m2.345s of user and 0m1.234s of system
    times | awk -v code=$code -v wall=$((SECONDS - begun)) -v what="$what" \
      'NR == 2 { split($0, t, /[ms ]+/); printf "%d %d %d %s\n", code, wall, 60 * (t[1] + t[3]) + t[2] + t[4], what }' \
      >>"$kept/results"
  ) | tee "$log"
}
# One script after the other; each line of output bears its script's name.
lane() {
  for script in "$@"; do run "$script" "$script" | sed -u "s|^|$(basename "$script" .sh): |"; done
}

computing=(tests/python.sh tests/gpdc_python.sh tests/recordings.sh tests/tcdf.sh tests/rustdds.sh tests/processors.sh tests/lint.sh)
waiting=(tests/interop/ros2.sh tests/soak.sh)
waiting_too=(tests/interop/ros1.sh tests/docs.sh tests/browser.sh tests/security.sh tests/safety.sh)
# A compiler waits for the disk now and then.
export CARGO_BUILD_JOBS=$(($(nproc) + 1))

# What the scripts need is fetched while cargo builds. Where this fails the script itself tells it, below.
for script in "${waiting[@]}" "${waiting_too[@]}" "${computing[@]}"; do "$script" --prepare 2>&1 | sed -u "s|^|$(basename "$script" .sh): |"; done &
preparing=$!
run "building" build_all
run "cargo test" cargo test "${workspace[@]}" --no-fail-fast
wait "$preparing"
# Cargo's lock is held while the wheel is built, and all lanes would wait for it.
run "building the wheel" env WHEELS="$kept" tests/python.sh --wheel

# Side by side: what waits for nodes, and what computes, which leaves the cores to the others when they want them.
lane "${waiting[@]}" &
lane "${waiting_too[@]}" &
{
  renice -n 10 -p "$BASHPID" >/dev/null 2>&1 || true
  lane "${computing[@]}"
} &
wait

sed -n 's/^[0-9]* \([0-9]*\) \([0-9]*\) \(.*\)/\3: \1 s, \2 s of CPU/p' "$kept/results"
sed -n 's/^77 [0-9]* [0-9]* \(.*\)/!!! NOT TESTED: \1 could not install what it needs (see above)/p' "$kept/results" >&2
# What a part that passed has left out.
grep -hE '^(!!! )?NOT TESTED: ' "$kept"/*.log | sed -E 's/^(!!! )?/!!! /' >&2
while read -r code _ _ what; do
  [[ $code = 0 || $code = 77 ]] && continue
  echo "!!! FAILED: $what" >&2
  grep -hE -A 8 '^(FAIL|!!! )|FAILED|^error|panicked at' "$kept/${what//\//_}.log" | head -60 >&2
  echo "--- the end of its output:" >&2
  tail -25 "$kept/${what//\//_}.log" >&2
done <"$kept/results"
parts=$((3 + ${#waiting[@]} + ${#waiting_too[@]} + ${#computing[@]}))
[ "$(wc -l <"$kept/results")" = "$parts" ] || { echo "!!! FAILED: not all of the $parts parts have told how they ended" >&2; exit 1; }
! grep -qvE '^(0|77) ' "$kept/results"
