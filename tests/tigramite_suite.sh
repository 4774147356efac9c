#!/usr/bin/env bash
# tests/tigramite_suite.sh CHECKOUT [PYTEST ARGUMENTS]: tigramite's own tests, from a checkout of it that you have, against
# roscausal's classes. Nothing of the checkout enters this repository. tigramite's tests need Python 3.11 or older (PYTHON=...).
# WHEEL=FILE takes a wheel that is built already. Exit code: pytest's.
set -uo pipefail
[ $# -ge 1 ] || { echo "usage: tests/tigramite_suite.sh CHECKOUT [PYTEST ARGUMENTS]" >&2; exit 2; }
checkout=$(cd "$1" && pwd) || exit 2
shift
cd "$(dirname "$0")/.."
. tests/lib.sh

python=${PYTHON:-python3}
"$python" -c 'import sys; sys.exit(sys.version_info >= (3, 12))' || give_up "tigramite's tests need Python 3.11 or older"
[ -d "$checkout/tests" ] || broken "there is no folder tests in $checkout"
made=$(mktemp -d)
trap 'rm -rf "$made"' EXIT
if [ -z "${WHEEL:-}" ]; then
  environment "$PWD/target/python-tools" "maturin>=1.16,<2"
  PATH=$PWD/target/python-tools/bin:$PATH maturin build --quiet --profile "$profile" --locked --manifest-path roscausal_py/Cargo.toml \
    --out "$made" || broken "the wheel does not build"
  WHEEL=$(ls "$made"/*.whl)
fi
"$python" -m venv "$made/venv" && "$made/venv/bin/pip" install --quiet --disable-pip-version-check "$WHEEL" pytest \
  tigramite==5.2.10.1 numpy==2.3.5 numba scikit-learn dcor setuptools || give_up "tigramite cannot be installed from PyPI"

# Those of its tests that use what the package covers; the private functions are not there.
cd "$made"
tests=()
for name in test_pcmci_simple test_pcmci_calculations test_pcmciplus_calculations test_data_processing test_independence_tests; do
  for file in "$checkout"/tests/"$name"*.py; do [ -e "$file" ] && tests+=("$file"); done
done
[ ${#tests[@]} -gt 0 ] || tests=("$checkout/tests")
"$made/venv/bin/python" -m pytest -p roscausal.tigramite.pytest_plugin -p no:cacheprovider -q "${tests[@]}" "$@"
