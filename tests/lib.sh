# What the test scripts share; to be sourced.

# Says that nothing could be tested, and why: exit code 77 for the caller.
give_up() {
  echo "NOT TESTED: $1" >&2
  echo "0 passed, 1 failed"
  exit 77
}

# Says that a part which must be there could not be made.
broken() {
  echo "$1" >&2
  echo "0 passed, 1 failed"
  exit 1
}

# debian PACKAGE...: installs them, as root where there is apt-get; another build's lock is waited for.
debian() {
  [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null || give_up "missing: $* (as root: apt-get install $*)"
  echo "installing $* ..."
  local log
  log=$(mktemp)
  { apt-get -q -o DPkg::Lock::Timeout=300 update && DEBIAN_FRONTEND=noninteractive apt-get -q -y \
    -o DPkg::Lock::Timeout=300 install --no-install-recommends "$@"; } >"$log" 2>&1 || {
    tail -20 "$log"
    give_up "apt-get cannot install these packages: $*"
  }
  rm -f "$log"
}

# environment FOLDER PACKAGE...: a virtual environment of Python with these packages of PyPI, made once.
environment() {
  local folder=$1
  shift
  [ "$(cat "$folder/complete" 2>/dev/null)" = "$*" ] && return
  python3 -c 'import ensurepip' 2>/dev/null || debian python3-venv
  python3 -m venv "$folder" && "$folder/bin/pip" install --quiet --disable-pip-version-check "$@" ||
    give_up "these packages cannot be installed from PyPI: $*"
  echo "$*" >"$folder/complete"
}

# build_all [--quiet]: builds all programs, tests and examples. Always the whole workspace: a package alone has its
# dependencies with other features, and builds them once more.
build_all() {
  cargo test --release --workspace --locked --no-run "$@"
}

# program NAME: where cargo puts a program.
program() {
  case ${CARGO_TARGET_DIR:-} in
    /*) echo "$CARGO_TARGET_DIR/release/$1" ;;
    *) echo "$PWD/${CARGO_TARGET_DIR:-target}/release/$1" ;;
  esac
}
