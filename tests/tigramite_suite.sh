#!/usr/bin/env bash
# tests/tigramite_suite.sh CHECKOUT [PYTEST ARGUMENTS]: tigramite's own tests, from a checkout of it that you have, against
# roscausal's classes. Nothing of the checkout enters this repository. CHECKOUT may be its unpacked source distribution:
#   pip download --no-deps --no-build-isolation --no-binary :all: tigramite==5.2.10.1
# tigramite's tests need Python 3.11 or older (PYTHON=...). WHEEL=FILE takes a wheel that is built already. Exit code: pytest's.
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

# Those of its tests that use what the package covers: 179 in version 5.2.10.1. The others are of private functions
# (test_pcmci_construction, test_independence_tests) and of what the package refuses by name.
tests=()
for name in test_construct_array test_pcmci_calculations; do
  [ -e "$checkout/tests/$name.py" ] || broken "there is no tests/$name.py in $checkout"
  tests+=("$checkout/tests/$name.py")
done
export PYTHONDONTWRITEBYTECODE=1 PYTHONPATH=$PWD/roscausal_py/tests
cd "$made"
"$made/venv/bin/python" -m pytest -p in_tigramites_place -p no:cacheprovider -q "${tests[@]}" "$@"
