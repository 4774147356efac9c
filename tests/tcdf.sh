#!/usr/bin/env bash
# The example of a method in another language, examples/methods/tcdf, as the discovery node calls it. It needs PyTorch: that of
# a Python on the path, else Debian's (150 MB). Exit 77 when it cannot be had.
set -uo pipefail
cd "$(dirname "$0")/.."
. tests/lib.sh

with_torch() { # a Python that has it
  for candidate in python3 /usr/bin/python3; do
    "$candidate" -c 'import torch' 2>/dev/null && echo "$candidate" && return
  done
  return 1
}
with_torch >/dev/null || debian python3-torch
python=$(with_torch) || give_up "PyTorch cannot be imported"
prepare_only "$@"
exec "$python" tests/tcdf.py "$python"
