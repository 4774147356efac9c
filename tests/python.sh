#!/usr/bin/env bash
# The Python package as a user gets it: builds the wheel, installs it into a clean environment that has numpy and nothing else,
# and tests it there; then types, stubs and the documentation's examples. Exit 77 when the tools cannot be had. WHEELS=DIR keeps
# the wheel; --wheel builds it and tests nothing.
set -uo pipefail
cd "$(dirname "$0")/.."
. tests/lib.sh

tools=$PWD/target/python-tools
environment "$tools" "maturin>=1.16,<2"
prepare_only "$@"
wheels=${WHEELS:-$(mktemp -d)}
made=$(mktemp -d)
trap 'rm -rf "$made"' EXIT
failed=()
part() { # what, then the command
  local what=$1
  shift
  echo "== Python: $what (after $SECONDS s)"
  "$@" || { echo "!!! FAILED: Python: $what" >&2; failed+=("$what"); }
}

echo "== Python: building the wheel"
PATH=$tools/bin:$PATH maturin build --quiet --profile "$profile" --locked --manifest-path roscausal_py/Cargo.toml --interpreter python3 \
  --out "$wheels" || broken "the wheel does not build"
[[ ${1:-} = --wheel ]] && exit 0
wheel=$(ls -t "$wheels"/roscausal-*.whl | head -1)
bytes=$(stat -c %s "$wheel")
echo "$(basename "$wheel"): $bytes bytes"
# Users get at most 10 MB: packaging/release.sh sees to that. The checks that tests are built with make the code larger.
most=16000000
part "the wheel has at most $most bytes" test "$bytes" -le $most

# A user's environment: the wheel and what it asks for.
clean=$made/clean
python3 -m venv "$clean" && "$clean/bin/pip" install --quiet --disable-pip-version-check "$wheel" ||
  give_up "numpy cannot be installed from PyPI"
part "numpy is all it needs" test -z "$("$clean/bin/pip" list --format freeze | grep -viE '^(numpy|pip|setuptools|roscausal|wheel)==')"
part "the README's three lines" "$clean/bin/python" -c 'import roscausal as rc
model = rc.demo()
print(model)
assert [(link.cause, link.effect) for link in model.links], model'
"$clean/bin/pip" install --quiet --disable-pip-version-check pytest || give_up "pytest cannot be installed from PyPI"
part "tests with nothing but numpy" "$clean/bin/python" -m pytest -q -p no:cacheprovider roscausal_py/tests
part "examples of the documentation" "$clean/bin/python" -m pytest -q -p no:cacheprovider --doctest-modules --pyargs roscausal

# Programs that users have beside it.
"$clean/bin/pip" install --quiet --disable-pip-version-check mypy pandas polars pyarrow xarray networkx matplotlib nbclient ipykernel jsonschema ||
  give_up "pandas, polars, pyarrow, xarray, networkx, matplotlib, nbclient, jsonschema or mypy cannot be installed from PyPI"
# Of these only the graphs: their programs bring Java, torch and others.
"$clean/bin/pip" install --quiet --disable-pip-version-check scipy pydot rectangle-packer grandalf &&
  "$clean/bin/pip" install --quiet --disable-pip-version-check --no-deps causal-learn py-causalflow ||
  give_up "causal-learn or py-causalflow cannot be installed from PyPI"
part "tables, graphs and pictures of others" "$clean/bin/python" -m pytest -q -p no:cacheprovider roscausal_py/tests/others.py
part "models are as their JSON Schema says" "$clean/bin/python" tests/schema.py "$clean/bin/roscausal"
part "notebooks" "$clean/bin/python" -m pytest -q -p no:cacheprovider roscausal_py/tests/notebooks.py
part "a user's script is typed" "$clean/bin/python" -m mypy --strict roscausal_py/tests/typed.py
part "and runs" "$clean/bin/python" roscausal_py/tests/typed.py
part "the package is typed" "$clean/bin/python" -m mypy --strict --package roscausal
part "the stub is the native module" "$clean/bin/python" -m mypy.stubtest roscausal._native
"$clean/bin/pip" install --quiet --disable-pip-version-check "ray>=2.40" distributed fsspec s3fs "aiobotocore[boto3]" "moto[s3]" flask flask-cors ||
  give_up "ray, distributed, s3fs or moto cannot be installed from PyPI"
part "a fleet's recordings on one machine, on Ray and on Dask" "$clean/bin/python" -m pytest -q -p no:cacheprovider roscausal_py/tests/fleet.py

# The reference, in an environment of its own: it brings a compiler of Python.
reference=$made/reference
python3 -m venv "$reference" && "$reference/bin/pip" install --quiet --disable-pip-version-check "$wheel" pytest matplotlib seaborn networkx \
  tigramite==5.2.10.1 numba scikit-learn dcor || give_up "tigramite cannot be installed from PyPI"
part "60 configurations give tigramite's numbers" "$reference/bin/python" -m pytest -q -p no:cacheprovider roscausal_py/tests/combinations.py
part "effects and mediation in tigramite's numbers" "$reference/bin/python" -m pytest -q -p no:cacheprovider roscausal_py/tests/effects.py
part "a program in tigramite's words gives its numbers" "$reference/bin/python" tests/tutorials.py --least 100 roscausal_py/tests/words.ipynb

# The same wheel on the other Pythons of this machine.
found() { # VERSION: a Python that runs, on the path or of pyenv
  for candidate in "python$1" "${PYENV_ROOT:-$HOME/.pyenv}/versions/$1".*/bin/python; do
    "$candidate" -c 'import ensurepip' 2>/dev/null && echo "$candidate" && return
  done
  return 1
}
for version in 3.10 3.11 3.12 3.13; do
  python=$(found $version) || {
    echo "NOT TESTED: Python $version is not on this machine" >&2
    continue
  }
  other=$made/$version
  "$python" -m venv "$other" && "$other/bin/pip" install --quiet --disable-pip-version-check "$wheel" pytest &&
    part "tests on Python $version" "$other/bin/python" -m pytest -q -p no:cacheprovider roscausal_py/tests/test_discover.py
done
# Once more at the end, where it is looked for.
for what in ${failed[@]+"${failed[@]}"}; do echo "!!! FAILED: Python: $what" >&2; done
[ ${#failed[@]} -eq 0 ]
