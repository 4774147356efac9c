"""The reference implementation's classes under their own names: a program that uses tigramite changes its imports only.

`pcmci.PCMCI` has an example. Names, defaults, shapes and keys are tigramite's (5.2). What is not covered raises `NotImplementedError` with its name.
"""

import sys
from importlib.abc import MetaPathFinder
from typing import Any

from .refusal import missing


class _Modules(MetaPathFinder):
    """Asked last: a module of tigramite that is not here is refused by its name."""

    def find_spec(self, fullname: str, path: Any = None, target: Any = None) -> None:
        """Refuses it."""
        parent, _, name = fullname.rpartition(".")
        if parent.startswith(__name__) and not name.startswith("_"):
            missing(parent, name)(name)


sys.meta_path.append(_Modules())
