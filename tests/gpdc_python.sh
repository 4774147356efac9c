#!/usr/bin/env bash
# The native GPDC against the reference's Python implementation in an embedded interpreter (feature `python`), and the maxima
# of its Gaussian process likelihoods against scikit-learn's on regressions drawn anew (COUNT=20000 for a long night's run).
# Exit 0 only when they agree; 77 when the Python packages cannot be had. Makes its own environment below target/.
set -uo pipefail
cd "$(dirname "$0")/.."
. tests/lib.sh

venv=$PWD/target/gpdc-python-venv
environment "$venv" tigramite==5.2.10.1 numpy==2.3.5 numba scikit-learn dcor
config() { "$venv/bin/python" -c "import sysconfig; print(sysconfig.get_config_var('$1') or '')"; }
library=$(config LIBDIR)
if [ ! -e "$library/$(config LDLIBRARY)" ] && [ ! -e "$(config LIBPL)/$(config LDLIBRARY)" ]; then
  debian libpython3-dev
fi
prepare_only "$@"

export PYO3_PYTHON=$venv/bin/python
export LD_LIBRARY_PATH=$library${LD_LIBRARY_PATH:+:$LD_LIBRARY_PATH}
PYTHONPATH=$("$venv/bin/python" -c "import sysconfig; print(sysconfig.get_paths()['purelib'])")
export PYTHONPATH
special gpdc_python cargo test "${workspace[@]}" --features roscausal_discovery/python --test gpdc_python || exit 1

build_all --quiet || exit 1
roscausal=$(program roscausal)
recordings=$(mktemp -d)
trap 'rm -rf "$recordings"' EXIT
for seed in 1 2 3; do
  "$roscausal" demo --scenario thor --seed $((RANDOM + 1)) --out "$recordings/thor$seed" >/dev/null &&
    "$roscausal" demo --seed $((RANDOM + 1)) --out "$recordings/encounters$seed" >/dev/null || exit 1
done
"$venv/bin/python" tests/gpdc/optima.py "$(program examples/gp_optima)" --count "${COUNT:-500}" --recordings "$recordings"
