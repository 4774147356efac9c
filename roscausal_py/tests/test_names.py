"""Every public name says what it is, and shows it."""

import importlib
import inspect
import pkgutil

import pytest

import roscausal as rc
import roscausal.tigramite

#: `help()` of these is their value.
CONSTANTS = {"__version__"}
#: Hooks and helpers of the package itself.
INTERNAL = {"roscausal.message", "roscausal.page", "roscausal.version", "roscausal.__main__"}


def modules():
    for package in (rc, roscausal.tigramite):
        for found in pkgutil.walk_packages(package.__path__, package.__name__ + "."):
            if found.name not in INTERNAL and not found.name.rpartition(".")[2].startswith("_"):
                yield importlib.import_module(found.name)


def public():
    """Classes and functions that a user may import, by their full name."""
    found = {f"roscausal.{name}": getattr(rc, name) for name in rc.__all__ if name not in CONSTANTS}
    for module in modules():
        if module.__name__.startswith("roscausal.tigramite"):
            own = {name: value for name, value in vars(module).items() if getattr(value, "__module__", "") == module.__name__}
            found |= {f"{module.__name__}.{name}": value for name, value in own.items() if inspect.isclass(value)}
    return found


PUBLIC = public()


@pytest.mark.parametrize("name", PUBLIC)
def test_a_public_name_has_a_docstring_with_an_example(name):
    text = inspect.getdoc(PUBLIC[name]) or ""
    assert ">>> " in text or name.endswith((".CondIndTest", "._Modules")), f"{name} has no example"


@pytest.mark.parametrize("name", [name for name, value in PUBLIC.items() if inspect.isclass(value)])
def test_the_methods_of_a_public_class_have_docstrings(name):
    members = {key: value for key, value in vars(PUBLIC[name]).items() if not key.startswith("_")}
    methods = {key: value for key, value in members.items() if callable(value) or hasattr(value, "fget") or hasattr(value, "func")}
    assert not [key for key, value in methods.items() if not inspect.getdoc(getattr(value, "func", value))]


@pytest.mark.parametrize("name", [name for name, value in PUBLIC.items() if inspect.isfunction(value)])
def test_a_function_documents_each_argument(name):
    text = inspect.getdoc(PUBLIC[name])
    arguments = inspect.signature(PUBLIC[name]).parameters
    assert not [argument for argument in arguments if f"{argument}:" not in text]
