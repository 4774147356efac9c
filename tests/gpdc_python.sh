#!/usr/bin/env bash
# The native GPDC against the reference's Python implementation in an embedded interpreter (feature `python`).
# Exit 0 only when they agree; 77 when the Python packages cannot be had. Makes its own environment below target/.
set -uo pipefail
cd "$(dirname "$0")/.."

give_up() {
  echo "NOT TESTED: $1" >&2
  exit 77
}

environment=$PWD/target/gpdc-python-venv
packages=(tigramite==5.2.10.1 numpy==2.3.5 numba scikit-learn dcor)
debian() {
  [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null || return 1
  apt-get -qq -o DPkg::Lock::Timeout=300 update
  DEBIAN_FRONTEND=noninteractive apt-get -qq -y -o DPkg::Lock::Timeout=300 install --no-install-recommends "$@" >/dev/null
}
if [ ! -e "$environment/complete" ]; then
  python3 -c 'import ensurepip' 2>/dev/null || debian python3-venv || give_up "python3 with venv is missing (apt-get install python3-venv)"
  python3 -m venv "$environment" && "$environment/bin/pip" install --quiet "${packages[@]}" ||
    give_up "these packages cannot be installed from PyPI: ${packages[*]}"
  touch "$environment/complete"
fi
config() { "$environment/bin/python" -c "import sysconfig; print(sysconfig.get_config_var('$1') or '')"; }
library=$(config LIBDIR)
if [ ! -e "$library/$(config LDLIBRARY)" ] && [ ! -e "$(config LIBPL)/$(config LDLIBRARY)" ]; then
  debian libpython3-dev || give_up "the library of Python is missing (apt-get install libpython3-dev)"
fi

export PYO3_PYTHON=$environment/bin/python
export LD_LIBRARY_PATH=$library${LD_LIBRARY_PATH:+:$LD_LIBRARY_PATH}
PYTHONPATH=$("$environment/bin/python" -c "import sysconfig; print(sysconfig.get_paths()['purelib'])")
export PYTHONPATH
cargo test --locked --package roscausal_core --features python --lib -- gpdc_python
