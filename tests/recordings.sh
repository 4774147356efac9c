#!/usr/bin/env bash
# Recordings against other software: files written by PyPI's rosbags and mcap, and by a real rosbag if there is one,
# are read by us, and what we write is read by them. Ends with 'N passed, N failed'; exit 0 only if all passed, 77
# if nothing could be tested. Needs python3 with venv (installs it as root on Debian); makes its own environment
# below target/.
#   tests/recordings.sh [--renew]     --renew rewrites the small files in roscausal_recording/tests/data and
#                                     tests/recordings/people
set -uo pipefail
cd "$(dirname "$0")/.."
. tests/lib.sh
here=$PWD

passed=0 failed=0
check() {
  local name=$1
  shift
  if "$@" >"$folder/log" 2>&1; then
    passed=$((passed + 1))
    echo "ok      $name"
  else
    failed=$((failed + 1))
    echo "FAILED  $name"
    tail -n 40 "$folder/log"
  fi
}

venv=target/recordings-venv
environment "$venv" rosbags==0.11.9 mcap==1.6.0 mcap-ros2-support==0.6.0
python=$here/$venv/bin/python
prepare_only "$@"

if [[ "${1:-}" == --renew ]]; then
  rm -rf roscausal_recording/tests/data
  "$python" tests/recordings/write.py roscausal_recording/tests/data 12
  rm -rf tests/recordings/people
  mkdir tests/recordings/people
  "$python" tests/recordings/people.py tests/recordings/people/people
fi

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
export ROSCAUSAL_RECORDINGS="$folder" ROSCAUSAL_RECORDED=3000
check "rosbags and mcap write thirteen recordings" "$python" tests/recordings/write.py "$folder" "$ROSCAUSAL_RECORDED"
if /usr/bin/python3 -c 'import rosbag' 2>/dev/null; then
  check "the real rosbag writes them again" /usr/bin/python3 tests/recordings/rewrite.py "$folder"
else
  echo "        (no rosbag of ROS 1 on this machine: its bags are not tested)"
fi
build_all --quiet || give_up "the program cannot be built"
roscausal=$(program roscausal)

check "we read them with equal contents" cargo test --quiet "${workspace[@]}" --test recordings
check "rosbags writes the people of a dozen trackers" "$python" tests/recordings/people.py "$folder/people"
check "we read them where they were" env ROSCAUSAL_PEOPLE="$folder" cargo test --quiet "${workspace[@]}" --test people
check "we write a file" cargo test --quiet "${workspace[@]}" --test written
check "mcap and rosbags read it back with equal contents" "$python" tests/recordings/read.py "$folder/ours.mcap"

# A feature, and crates that nothing else needs: built for this test alone.
check "Parquet and Arrow files of pandas, polars and pyarrow are read" cargo test --quiet "${workspace[@]}" \
  --features roscausal_core/columnar --test columnar

# The commands, on a bag that rosbags wrote.
quick=(--method pcmci --test parcorr)
check "rosbags writes a walk past a robot" "$python" tests/recordings/walk.py "$folder/walk"
for file in walk.bag walk_mcap walk_db3; do
  check "roscausal discover $file" "$roscausal" discover "$folder/$file" "${quick[@]}" --robot-odom /odom --people /people
  "$roscausal" discover "$folder/$file" "${quick[@]}" --out "$folder/$file.found" >/dev/null 2>&1
done
head -c $(($(stat -c %s "$folder"/walk_db3/*.db3) * 85 / 100)) "$folder"/walk_db3/*.db3 >"$folder/cut.db3"
check "roscausal discover a database without its last 15 %" bash -c '"$1" discover "$2" --method pcmci --test parcorr --format json \
  | "$3" -c "import json, sys; n = json.load(sys.stdin)[\"n_samples\"]; print(n); assert 900 < n < 1100"' - "$roscausal" "$folder/cut.db3" "$python"
for other in walk_mcap walk_db3; do
  # Warnings must name the file.
  for file in walk.bag $other; do
    "$python" -c 'import json, sys; m = json.load(open(sys.argv[1])); del m["warnings"]; assert m["links"]; print(m)' \
      "$folder/$file.found/model.json" >"$folder/$file.model"
  done
  check "walk.bag and $other give one model" cmp "$folder/walk.bag.model" "$folder/$other.model"
done

cd "$folder"
check "roscausal demo --record" "$roscausal" demo --seed 3 --duration 60 --out demo --record demo.mcap "${quick[@]}"
check "every topic of the demo is read back by mcap and rosbags" "$python" "$here/tests/recordings/read_run.py" demo.mcap demo/model.json
cd "$here"

echo "$passed passed, $failed failed"
[ "$failed" = 0 ]
