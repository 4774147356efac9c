#!/usr/bin/env bash
# The live page in a real browser: Debian's chromium without a window, driven by Selenium, with axe-core for
# accessibility. Keeps screenshots in target/browser/. Ends with 'N passed, N failed'; exit 0 only when all passed, 77
# when nothing could be tested. As root on Debian it installs what is missing.
#   tests/browser.sh [--keep FILE.png]      copies the wide screenshot to FILE.png
set -uo pipefail
cd "$(dirname "$0")/.."
here=$PWD

give_up() {
  echo "NOT TESTED: $1" >&2
  echo "0 passed, 1 failed"
  exit 77
}

missing=()
for package in chromium chromium-driver python3-venv npm; do
  case $package in
    chromium) command -v chromium >/dev/null ;;
    chromium-driver) command -v chromedriver >/dev/null ;;
    python3-venv) python3 -c 'import ensurepip' 2>/dev/null ;;
    npm) command -v npm >/dev/null ;;
  esac || missing+=("$package")
done
if [ ${#missing[@]} -gt 0 ]; then
  [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null || give_up "missing: ${missing[*]} (apt-get install ${missing[*]})"
  echo "installing ${missing[*]} ..."
  apt-get -qq -o DPkg::Lock::Timeout=300 update >/dev/null 2>&1
  DEBIAN_FRONTEND=noninteractive apt-get -qq -y -o DPkg::Lock::Timeout=300 install --no-install-recommends \
    "${missing[@]}" >/dev/null 2>&1 || give_up "these packages cannot be installed: ${missing[*]}"
fi

environment=target/browser-venv
if ! "$environment/bin/python" -c 'import selenium' 2>/dev/null; then
  python3 -m venv "$environment" && "$environment/bin/pip" install --quiet selenium==4.49.0 ||
    give_up "selenium cannot be installed from PyPI"
fi
axe=target/browser-axe/node_modules/axe-core/axe.min.js
if [ ! -f "$axe" ]; then
  npm install --silent --no-audit --no-fund --prefix target/browser-axe axe-core@4.14.1 >/dev/null ||
    give_up "axe-core cannot be installed from npm"
fi

cargo build --quiet --locked --bin roscausal || give_up "the program cannot be built"
roscausal=$here/${CARGO_TARGET_DIR:-target}/debug/roscausal
case ${CARGO_TARGET_DIR:-} in /*) roscausal=$CARGO_TARGET_DIR/debug/roscausal ;; esac

mkdir -p target/browser
"$environment/bin/python" tests/browser/page.py "$roscausal" "$axe" target/browser
code=$?
if [ "${1:-}" = --keep ]; then cp target/browser/wide-light.png "$2"; fi
exit $code
