#!/usr/bin/env bash
# The live page in a real browser: Debian's chromium, headless, driven by Selenium, with axe-core for
# accessibility. Keeps screenshots in target/browser/. Ends with 'N passed, N failed'; exit 0 only if all passed, 77
# if nothing could be tested. As root on Debian it installs what is missing.
#   tests/browser.sh [--keep FILE.png]      copies the wide screenshot to FILE.png
set -uo pipefail
cd "$(dirname "$0")/.."
. tests/lib.sh

missing=()
for package in chromium chromium-driver python3-venv npm; do
  case $package in
    chromium) command -v chromium >/dev/null ;;
    chromium-driver) command -v chromedriver >/dev/null ;;
    python3-venv) python3 -c 'import ensurepip' 2>/dev/null ;;
    npm) command -v npm >/dev/null ;;
  esac || missing+=("$package")
done
[ ${#missing[@]} -eq 0 ] || debian "${missing[@]}"

venv=target/browser-venv
environment "$venv" selenium==4.49.0
axe=target/browser-axe/node_modules/axe-core/axe.min.js
if [ ! -f "$axe" ]; then
  npm install --silent --no-audit --no-fund --prefix target/browser-axe axe-core@4.14.1 >/dev/null ||
    give_up "axe-core cannot be installed from npm"
fi
prepare_only "$@"

build_all --quiet || give_up "the program cannot be built"
[ -f target/docs/index.html ] || tests/docs.sh
roscausal=$(program roscausal)

mkdir -p target/browser
"$venv/bin/python" tests/browser/page.py "$roscausal" "$axe" target/browser
code=$?
if [ "${1:-}" = --keep ]; then cp target/browser/wide-light.png "$2"; fi
exit $code
