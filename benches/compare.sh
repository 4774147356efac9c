#!/bin/sh
# The same data through this engine and through the Python references, side by side; prints the table in Markdown.
# usage: benches/compare.sh [--rows gpdc3,parcorr20,...] [--runs N] [--cap SECONDS] [--list]
#        benches/compare.sh --sizes [--rows pcmci-gpdc,...] [--cap SECONDS] [--pictures FOLDER]     a table over sizes, and pictures
#        benches/compare.sh --reasoning [--rows mediation3,...] [--cap SECONDS] [--list]      the questions of reasoning
# It makes its virtual environment under target/compare; F-PCMCI needs Java (Debian: default-jre-headless).
set -eu
cd "$(dirname "$0")/.."
work=target/compare
python=$work/venv/bin/python
mkdir -p "$work"
if [ ! -e "$work/venv/complete" ]; then
    python3 -m venv "$work/venv"
    "$python" -m pip install --quiet tigramite==5.2.10.1 numpy==2.3.5 numba scikit-learn dcor matplotlib networkx \
        antecedent==2.4.1 lingam==1.12.2
    # It asks for an older Python and for PyTorch, which its DYNOTEARS does without.
    "$python" -m pip install --quiet --no-deps --ignore-requires-python causalnex==0.12.2
    # A plain install of fpcmci pulls in gigabytes and still fails to import. This is what it really imports.
    "$python" -m pip install --quiet --no-warn-conflicts --no-deps fpcmci==4.4.1 idtxl-uv==1.6.1 netgraph rectangle-packer grandalf
    "$python" -m pip install --quiet --no-warn-conflicts numpy==2.3.5 jpype1 pandas ruptures statsmodels h5py
    touch "$work/venv/complete"
fi
if [ "${1:-}" = --reasoning ]; then
    shift
    # An environment of its own: dowhy wants other versions of what is above.
    python=$work/reasoning/bin/python
    if [ ! -e "$work/reasoning/complete" ]; then
        python3 -m venv "$work/reasoning"
        "$python" -m pip install --quiet tigramite==5.2.10.1 dowhy==0.14 antecedent==2.4.1
        touch "$work/reasoning/complete"
    fi
    cargo build --quiet --release --workspace --exclude roscausal_py --example reasoning_speed
    exec "$python" benches/reasoning.py "${CARGO_TARGET_DIR:-target}/release/examples/reasoning_speed" "$@"
fi
command -v java >/dev/null || echo "no java: the row of F-PCMCI will be empty (Debian: default-jre-headless)" >&2
cargo build --quiet --release --workspace --exclude roscausal_py --bin roscausal --example bench_case
if [ "${1:-}" = --sizes ]; then
    shift
    exec "$python" benches/sizes.py --work "$work" "$@"
fi
exec "$python" benches/compare.py --work "$work" "$@"
