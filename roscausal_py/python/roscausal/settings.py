"""The types of the settings of an analysis, from the table of settings. What a checker of types reads is settings.pyi."""

import json
from typing import Any, Literal, TypedDict

from . import _native

_words = json.loads(_native.words())
Method = Literal[tuple(_words["methods"])]
Settings = TypedDict("Settings", {one["id"]: Any for one in _words["settings"] if one["id"] != "test"}, total=False)
