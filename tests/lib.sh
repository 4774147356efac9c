# Functions that the test scripts share. Source this file.

# Reports that nothing could be tested, and why: exit code 77 for the caller. If something has failed before, in a script that counts
# or lists it in `failed`, that stays a failure.
give_up() {
  [ "${failed[*]:-0}" = 0 ] || broken "$1"
  echo "NOT TESTED: $1" >&2
  echo "0 passed, 1 failed"
  exit 77
}

# Reports that a required part could not be made.
broken() {
  echo "$1" >&2
  echo "0 passed, 1 failed"
  exit 1
}

# debian PACKAGE...: installs them if this is root and there is apt-get. Waits for the lock of another apt-get.
debian() {
  [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null || give_up "missing: $* (as root: apt-get install $*)"
  echo "installing $* ..."
  local log
  log=$(mktemp)
  # One at a time: `apt-get update` does not wait for another.
  {
    flock 9
    apt-get -q -o DPkg::Lock::Timeout=300 update && DEBIAN_FRONTEND=noninteractive apt-get -q -y \
      -o DPkg::Lock::Timeout=300 install --no-install-recommends "$@"
  } >"$log" 2>&1 9>"${TMPDIR:-/tmp}/roscausal-debian.lock" || {
    tail -20 "$log"
    give_up "apt-get cannot install these packages: $*"
  }
  rm -f "$log"
}

# What a catkin workspace with the packages of this repository is built with.
debian_catkin=(cmake make g++ catkin ros-message-generation ros-message-runtime python3-genmsg python3-genpy python3-gencpp
  ros-geometry-msgs libgeometry-msgs-dev python3-geometry-msgs ros-std-msgs libstd-msgs-dev python3-std-msgs)

# debian_missing PACKAGE...: installs those that are not there.
debian_missing() {
  local package missing=()
  for package in "$@"; do dpkg -s "$package" >/dev/null 2>&1 || missing+=("$package"); done
  [ ${#missing[@]} -eq 0 ] || debian "${missing[@]}"
}

# environment FOLDER PACKAGE...: a Python virtual environment with these packages from PyPI, made once.
environment() {
  local folder=$1
  shift
  [ "$(cat "$folder/complete" 2>/dev/null)" = "$*" ] && return
  python3 -c 'import ensurepip' 2>/dev/null || debian python3-venv
  python3 -m venv "$folder" && "$folder/bin/pip" install --quiet --disable-pip-version-check "$@" ||
    give_up "these packages cannot be installed from PyPI: $*"
  echo "$*" >"$folder/complete"
}

# prepare_only ARGUMENTS: ends a script that was called with --prepare. Each calls it when it has installed what it needs, so that
# tests/run.sh can do this while cargo builds.
prepare_only() {
  [ "${1:-}" != --prepare ] || exit 0
}

# What cargo is told: the profile that Cargo.toml makes for tests, and always the whole workspace: a single package would use its
# dependencies with other features, and build them again.
profile=checked
workspace=(--profile "$profile" --workspace --exclude roscausal_py --locked)

# build_all [--quiet]: builds all programs, tests and examples.
build_all() {
  cargo test "${workspace[@]}" --no-run "$@"
}

# program NAME: where cargo puts a program.
program() {
  case ${CARGO_TARGET_DIR:-} in
    /*) echo "$CARGO_TARGET_DIR/$profile/$1" ;;
    *) echo "$PWD/${CARGO_TARGET_DIR:-target}/$profile/$1" ;;
  esac
}

# special NAME COMMAND...: runs a cargo command that builds with other features than the rest, or the function `program`. Its programs lie
# in target/NAME, where no other script's build replaces them; everything else is shared with the other builds, and so is cargo's lock.
# (Cargo before 1.91 ignores CARGO_BUILD_BUILD_DIR, and builds everything anew there.)
special() {
  local built=${CARGO_TARGET_DIR:-target} name=$1
  shift
  CARGO_BUILD_BUILD_DIR=$built CARGO_TARGET_DIR=$built/$name "$@"
}
