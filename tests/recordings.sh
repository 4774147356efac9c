#!/usr/bin/env bash
# Recordings against other software: files written by PyPI's rosbags, mcap, mcap-ros1-support and mcap-ros2-support, and by a
# real rosbag if there is one, are read by us, and what we write is read by them. (rosbag2's own writer is in no registry; files that it
# wrote are in tests/recordings/foreign.) Ends with 'N passed, N failed'; exit 0 only if all passed, 77
# if nothing could be tested. Needs python3 with venv (installs it as root on Debian); makes its own environment
# below target/.
#   tests/recordings.sh [--renew]     --renew rewrites the small files in roscausal_recording/tests/data and
#                                     tests/recordings/people and tests/recordings/robots_*
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
environment "$venv" rosbags==0.11.9 mcap==1.6.0 mcap-ros1-support==0.9.0 mcap-ros2-support==0.6.0
python=$here/$venv/bin/python
prepare_only "$@"

if [[ "${1:-}" == --renew ]]; then
  rm -rf roscausal_recording/tests/data
  "$python" tests/recordings/write.py roscausal_recording/tests/data 12
  rm -rf tests/recordings/people
  mkdir tests/recordings/people
  "$python" tests/recordings/people.py tests/recordings/people/people
  robots=$(mktemp -d)
  "$python" tests/recordings/robots.py "$robots/robots"
  for kept in robots_nav2 robots_fleet robots_crowd; do
    rm -rf "tests/recordings/$kept"
    mv "$robots/$kept" tests/recordings/
  done
  rm -rf "$robots"
fi

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
export ROSCAUSAL_RECORDINGS="$folder" ROSCAUSAL_RECORDED=3000
check "rosbags, mcap and the support libraries of mcap write fifteen recordings" "$python" tests/recordings/write.py "$folder" "$ROSCAUSAL_RECORDED"
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
check "Parquet and Arrow files of pandas, polars and pyarrow are read" special columnar cargo test --quiet "${workspace[@]}" \
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
  # What is said of a file names it.
  for file in walk.bag $other; do
    "$python" -c 'import json, sys; m = json.load(open(sys.argv[1])); del m["warnings"], m["summary"]["notes"], m["summary"]["about_data"]; assert m["links"]; print(m)' \
      "$folder/$file.found/model.json" >"$folder/$file.model"
  done
  check "walk.bag and $other give one model" cmp "$folder/walk.bag.model" "$folder/$other.model"
done

# Robots as they record themselves, by rosbags: what is said of the choice, and what the tables hold.
says() { # SENTENCE, then a command
  local sentence=$1
  shift
  "$@" >"$folder/said" 2>&1 && grep -qF -- "$sentence" "$folder/said" || { cat "$folder/said"; return 1; }
}
check "rosbags writes robots of AMCL, of TF alone, of Nav2 and in namespaces" "$python" tests/recordings/robots.py "$folder/robots"
check "a robot that AMCL finds now and then has its place by odometry and TF" says \
  "robot pose: the pose in /odom, brought to the map by TF: it knows the robot in 100 % of the time" \
  "$roscausal" discover "$folder/robots_amcl.bag" "${quick[@]}" --drop-empty
check "its particles are not people" grep -qF "people: /people (geometry_msgs/PoseArray)" "$folder/said"
for file in robots_oldtf.bag robots_frames; do
  check "the robot of $file, where there is TF alone, is a frame" says "robot: the place of base_link in map by TF" \
    "$roscausal" discover "$folder/$file" "${quick[@]}" --drop-empty
done
check "of two robots in namespaces one is asked for by name" says "of the robots tb3_0, tb3_1" \
  bash -c '! "$@"' - "$roscausal" discover "$folder/robots_fleet" "${quick[@]}"
check "one of two robots is chosen by its name with all its topics" says "robot odometry: /tb3_1/odom" \
  "$roscausal" discover "$folder/robots_fleet" "${quick[@]}" --drop-empty --robot tb3_1
check "its goal is in its namespace" grep -qF "robot goal: /tb3_1/goal_pose" "$folder/said"
check "the other robot takes the place of people" says "people: /tb3_1/odom (nav_msgs/Odometry)" \
  "$roscausal" discover "$folder/robots_fleet" "${quick[@]}" --drop-empty --robot tb3_0 --people robots
check "robots that are in TF alone are told apart by their frames" says "robot: the place of tb3_1/base_link in map by TF" \
  "$roscausal" discover "$folder/robots_crowd" "${quick[@]}" --drop-empty --robot tb3_1
nav2=(--robot-goal /tb3_0/plan --signal 'left = length(/tb3_0/plan.poses)'
  --signal 'to_go = /tb3_0/navigate_to_pose/_action/feedback.feedback.distance_remaining'
  --signal 'v_cmd = /tb3_0/cmd_vel.twist.linear.x')
check "goal, plan, stamped commands and the action's feedback of Nav2 become columns" bash -c '
  "$1" replay "$2/robots_nav2" --out "$2/nav2" --method pcmci --test parcorr --ts-length 0 "${@:4}" && "$3" -c "
import csv, glob, sys
rows = list(csv.DictReader(open(glob.glob(sys.argv[1] + \"/nav2/data_pool/*.csv\")[0])))
values = [[float(row[name] or \"nan\") for name in (\"r_x\", \"r_gx\", \"left\", \"to_go\", \"v_cmd\")] for row in rows]
known = [row for row in values if all(value == value for value in row)]
assert len(known) > 190, len(known)
for x, goal, left, to_go, v_cmd in known:
    assert goal == 14 and abs(left - to_go) < 1e-4 and abs(left - (14 - x)) < 0.1 and 0 < v_cmd < 1, (x, goal, left, to_go, v_cmd)
" "$2"' - "$roscausal" "$folder" "$python" "${nav2[@]}"
check "what goes wrong with recordings is read right, or said, in every format" "$python" tests/recordings/trouble.py "$folder/trouble" "$roscausal"
signals=(--person nobody --signal 'v_cmd = /tb3_0/cmd_vel.twist.linear.x' --signal 'v = /tb3_0/odom.twist.twist.linear.x')
check "signals alone give a model" "$roscausal" discover "$folder/robots_nav2" "${quick[@]}" --ts-length 0 "${signals[@]}" --out "$folder/commands"
check "a command that is a signal is an action: faster commands, a faster robot" says "Best first: faster" \
  bash -c '"$1" whatif "$2/model.json" --data "$(ls "$2"/batches/*.csv)" --variables v --cost v:-1 \
    --action "faster: v_cmd=0.6" --action "slower: v_cmd=0.4"' - "$roscausal" "$folder/commands"

cd "$folder"
check "roscausal demo --record" "$roscausal" demo --seed 3 --duration 60 --out demo --record demo.mcap "${quick[@]}"
check "every topic of the demo is read back by mcap and rosbags" "$python" "$here/tests/recordings/read_run.py" demo.mcap demo/model.json
cd "$here"

echo "$passed passed, $failed failed"
[ "$failed" = 0 ]
