"""Causal discovery from time series: which variable drives which, and how many steps later.

>>> import numpy as np
>>> import roscausal as rc
>>> rng = np.random.default_rng(1)
>>> x = rng.normal(size=(300, 2))
>>> x[1:, 1] += 0.8 * x[:-1, 0]
>>> model = rc.discover(x, columns=["a", "b"], method="pcmci", test="parcorr")
>>> strongest = max(model.links, key=lambda link: link.value or 0)
>>> strongest.cause, strongest.effect, strongest.lag
('a', 'b', 1)

`discover` analyses data, `roll` each window of them, `read` reads robots' recordings and tables, `load` reads a model's file,
`demo` shows it all. A model answers questions: `Model.predict`, `Model.whatif`, `Model.effect`, `Model.explain`.
`roscausal.tigramite` has the reference implementation's classes under their own names.
"""

from ._native import Cancelled, DataError, SettingError
from .data import Recordings, read
from .model import Advice, Link, Model, Picture, load
from .quick import demo, discover, msg_definitions
from .reasoning import Contribution, Effect, Explanation, Forecast, Outlook, StructuralModel, WhatIf
from .rolling import Rolling, Window, roll
from .version import __version__

__all__ = [
    "Advice", "Cancelled", "Contribution", "DataError", "Effect", "Explanation", "Forecast", "Link", "Model", "Outlook",
    "Picture", "Recordings", "Rolling", "SettingError", "StructuralModel", "WhatIf", "Window", "__version__", "demo", "discover",
    "load", "msg_definitions", "read", "roll",
]  # fmt: skip
