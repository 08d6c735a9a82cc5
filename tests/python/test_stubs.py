"""The type stubs against the module: names, arguments, defaults and types, both ways.

pybind11 writes each signature as the first line of a docstring; the stub is read as a syntax tree.
(mypy's stubtest cannot see the signatures of a compiled module.)
"""

import ast
import inspect
import re
from pathlib import Path

import pytest

import unfurl
from unfurl import _core

STUB = ast.parse((Path(_core.__file__).parent / "_core.pyi").read_text())
CLASSES = {node.name: node for node in STUB.body if isinstance(node, ast.ClassDef)}
FUNCTIONS = {node.name: node for node in STUB.body if isinstance(node, ast.FunctionDef)}
# What Python gives every class, and what is no part of its use.
COMMON = set(dir(object)) - {"__init__"} | {"__module__", "__weakref__", "__setstate__"}


def signature_of(callable_object):
    """As pybind11 says it: 'name(a: int, *, b: float = 0.0) -> str'."""
    line = callable_object.__doc__.strip().splitlines()[0]
    line = re.sub(r"<[^>]*>", "...", line)  # a default that is no literal
    line = re.sub(r"= (-?)inf\b", r"= \g<1>1e999", line)
    name = line.partition("(")[0] or "property_"
    return ast.parse(f"def {name}{line[line.index('('):]}: ...").body[0]


def arguments_of(node):
    """[(name, keyword only, default)]: None without a default, '...' for one that the stub leaves open."""
    plain = node.args.args
    defaults = [None] * (len(plain) - len(node.args.defaults)) + node.args.defaults
    every = [(a, False, d) for a, d in zip(plain, defaults)]
    every += [(a, True, d) for a, d in zip(node.args.kwonlyargs, node.args.kw_defaults)]
    return [(a.arg, only, d and ast.literal_eval(d)) for a, only, d in every]


def type_of(annotation):
    text = ast.unparse(annotation).replace("unfurl._core.", "").replace("numpy.", "np.")
    for long, short in (("List", "list"), ("Dict", "dict"), ("Tuple", "tuple")):
        text = re.sub(rf"\b{long}\[", f"{short}[", text)
    text = text.replace("np.ndarray[bool]", "NDArray[np.bool_]").replace("np.ndarray", "NDArray")
    return text.replace("NDArray[np.float64]", "_Floats").replace("NDArray[np.int32]", "_Ints")


def assert_same_type(where, compiled, stub):
    """The module may say less: list, tuple, dict, object or an array of any kind."""
    said, promised = type_of(compiled), type_of(stub)
    if said in ("list", "tuple", "dict"):
        assert promised.startswith(said + "["), where
    elif said == "NDArray":
        assert promised in ("_Floats", "_Ints"), where
    elif said == "Comparison" and where == "Fit.comparison":  # a pointer that may be empty
        assert promised == "Optional[Comparison]"
    elif said == "Iterator":
        assert promised.startswith("Iterator["), where
    elif said != "object":
        assert promised == said, f"{where}: the module gives {said}, the stub says {promised}"


def assert_same_call(where, compiled, stub):
    ours, theirs = arguments_of(compiled), arguments_of(stub)
    first = slice(1, None) if ours and ours[0][0] in ("self", "arg0") else slice(None)
    ours, theirs = ours[first], theirs[first]
    # Operators and callbacks have no names of their own.
    assert len(ours) == len(theirs), f"{where}: {ours} and {theirs}"
    for (name, only, default), (name_b, only_b, default_b) in zip(ours, theirs):
        assert name == name_b or name.startswith("arg"), f"{where}: {name} and {name_b}"
        assert only == only_b, f"{where}: {name} by keyword only?"
        if default_b is ...:
            assert default is not None, f"{where}: {name} has no default"
        else:
            if isinstance(default_b, tuple):  # of a list, which the stub must not hold
                default_b = list(default_b)
            assert default == default_b, f"{where}: {name} = {default} and {default_b}"
    assert_same_type(where, compiled.returns, stub.returns)


def members_of(cls):
    own = {k: v for k, v in vars(cls).items() if k not in COMMON or k in ("__init__",)}
    if (own.get("__init__").__doc__ or "").startswith("Initialize self"):
        del own["__init__"]  # there is no constructor
    return own


def stub_members_of(node):
    return {item.name: item for item in node.body if isinstance(item, ast.FunctionDef)}


def exceptions(name):
    return issubclass(getattr(_core, name), Exception)


def test_module_and_stub_have_the_same_names():
    public = {name for name in vars(_core) if not name.startswith("_")}
    assert public == set(CLASSES) | set(FUNCTIONS)
    assert public <= set(unfurl.__all__)


@pytest.mark.parametrize("name", sorted(FUNCTIONS))
def test_functions(name):
    assert_same_call(name, signature_of(getattr(_core, name)), FUNCTIONS[name])


@pytest.mark.parametrize("name", sorted(n for n in CLASSES if not exceptions(n)))
def test_classes(name):
    ours, theirs = members_of(getattr(_core, name)), stub_members_of(CLASSES[name])
    assert set(ours) == set(theirs)
    for member, item in ours.items():
        where, stub = f"{name}.{member}", theirs[member]
        is_property = any(ast.unparse(d) == "property" for d in stub.decorator_list)
        assert isinstance(item, property) == is_property, where
        if is_property:
            assert_same_type(where, signature_of(item.fget).returns, stub.returns)
        else:
            assert_same_call(where, signature_of(item), stub)


@pytest.mark.parametrize("name", sorted(n for n in CLASSES if exceptions(n)))
def test_exceptions(name):
    bases = [ast.unparse(base) for base in CLASSES[name].bases]
    assert bases == [base.__name__ for base in getattr(_core, name).__bases__]


def test_every_member_says_what_it_is():
    """Arrays and numbers with shape and unit; a name that says all needs no more."""
    silent = []
    for name in CLASSES:
        for member, item in vars(getattr(_core, name)).items():
            if isinstance(item, property) and item.fget is not None:
                text = item.__doc__ or ""
                kind = ast.unparse(signature_of(item.fget).returns)
                if "ndarray" in kind and not re.search(r"\(.*\).*", text):
                    silent.append(f"{name}.{member}: no shape")
                elif kind == "float" and not re.search(r"\[.+\]|[Ss]hare|unit|[Ss]tandard", text):
                    silent.append(f"{name}.{member}: no unit")
            elif inspect.isroutine(item) and not member.startswith("_"):
                if len(item.__doc__.strip().splitlines()) < 3:
                    silent.append(f"{name}.{member}(): no word")
    assert not silent, "\n".join(silent)
