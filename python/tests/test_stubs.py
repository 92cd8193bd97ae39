"""The type stubs match the package: names, and the parameters of functions and methods."""

import ast
import inspect
import pathlib

import pytest

import escapement

PACKAGE = pathlib.Path(escapement.__file__).parent


def parameters_of(node):
    arguments = node.args
    names = [one.arg for one in arguments.posonlyargs + arguments.args + arguments.kwonlyargs]
    names += [one.arg for one in (arguments.vararg, arguments.kwarg) if one]
    return [name for name in names if name not in ("self", "cls")]


def stubs(file):
    """The functions and methods of a stub: dotted name to the parameters of each overload."""
    found, names = {}, set()
    tree = ast.parse((PACKAGE / file).read_text())
    for node in tree.body:
        if isinstance(node, (ast.ClassDef, ast.FunctionDef)):
            names.add(node.name)
        if isinstance(node, ast.FunctionDef):
            found.setdefault(node.name, []).append(parameters_of(node))
        for inner in node.body if isinstance(node, ast.ClassDef) else ():
            if isinstance(inner, ast.FunctionDef):
                found.setdefault(f"{node.name}.{inner.name}", []).append(parameters_of(inner))
    return names, found


@pytest.mark.parametrize("file", ["__init__.pyi", "gym.pyi"])
def test_stubs_agree_with_the_module(file):
    module = escapement
    if file == "gym.pyi":
        module = pytest.importorskip("escapement.gym")
    names, found = stubs(file)
    if module is escapement:
        assert set(escapement.__all__) <= names
    for name, overloads in found.items():
        # The result of `save` is a class of the Rust module.
        if name.startswith("Saved."):
            continue
        thing = module
        for part in name.split("."):
            thing = inspect.getattr_static(thing, part) if inspect.isclass(thing) else getattr(thing, part)
        if isinstance(thing, property):
            continue
        function = getattr(thing, "__func__", thing)
        function = function.__init__ if inspect.isclass(function) else function
        real = [one for one in inspect.signature(function).parameters if one not in ("self", "cls")]
        for written in overloads:
            if not name.endswith("__init_subclass__"):
                assert sorted(written) == sorted(real), name


def test_package_is_typed():
    assert (PACKAGE / "py.typed").exists()
