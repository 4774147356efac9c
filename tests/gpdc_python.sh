#!/usr/bin/env bash
# The native GPDC against the Python reference in an embedded interpreter (feature `python`).
# Exit 0 only if they agree; 77 if the Python packages are not available. Makes its own environment below target/.
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

export PYO3_PYTHON=$venv/bin/python
export LD_LIBRARY_PATH=$library${LD_LIBRARY_PATH:+:$LD_LIBRARY_PATH}
PYTHONPATH=$("$venv/bin/python" -c "import sysconfig; print(sysconfig.get_paths()['purelib'])")
export PYTHONPATH
cargo test --release --locked --workspace --features roscausal_discovery/python --test gpdc_python
