"""Runs another program's tests of tigramite against roscausal: `pytest -p in_tigramites_place`, see tests/tigramite_suite.sh.

Before the tests are imported, `PCMCI`, `DataFrame` and the five independence tests of `tigramite` are replaced by ours. Toy
models and `OracleCI` stay tigramite's.
"""

from __future__ import annotations

import importlib
import sys

#: Module of tigramite, and of ours, to the names that are replaced.
REPLACED = {
    "pcmci": ["PCMCI"],
    "data_processing": ["DataFrame"],
    "independence_tests.parcorr": ["ParCorr"],
    "independence_tests.robust_parcorr": ["RobustParCorr"],
    "independence_tests.gpdc": ["GPDC"],
    "independence_tests.cmiknn": ["CMIknn"],
    "independence_tests.gsquared": ["Gsquared"],
}


def replace() -> list[str]:
    """Puts our classes in tigramite's place, and returns their names.

    Raises:
        ImportError: tigramite is not there.
    """
    done = []
    for module, names in REPLACED.items():
        theirs = importlib.import_module(f"tigramite.{module}")
        ours = importlib.import_module(f"roscausal.tigramite.{module}")
        for name in names:
            old, new = getattr(theirs, name), getattr(ours, name)
            for loaded in list(sys.modules.values()):
                if getattr(loaded, "__name__", "").startswith("tigramite") and getattr(loaded, name, None) is old:
                    setattr(loaded, name, new)
            done.append(f"{module}.{name}")
    return done


def pytest_configure() -> None:
    """Called by pytest before it collects."""
    print(f"roscausal takes the place of {', '.join(replace())}")
