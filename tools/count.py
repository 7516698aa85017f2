"""Counts what makes a checkout large or tangled, each with its limit: lines, files, functions, imports, names, walks.

    python tools/count.py [CHECKOUT]          # this checkout by default
    python tools/count.py [CHECKOUT] --walk   # also runs a small study there, and follows an option's value to its row

An option's walk: `run --view-size 61` in one process, the drawing worker in another. Counted are the files with a
function that is given or returns a value holding 61 before the first row is stored, directly or in an object's
fields; `return steps`, functions of the package that return such a value to another file; and the package's classes
whose objects hold it, which are the types between a view and its row. Not seen, and so to be counted by hand: what
the worker does with a request, values that are derived from the option, and types that hold none of it, as a mask.
"""

import argparse
import ast
import os
import re
import sys
import tempfile
import tomllib
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Mapping
from contextlib import redirect_stdout, suppress
from pathlib import Path
from typing import Any

import grimp
import numpy as np
from scipy.sparse.csgraph import connected_components

PAGES = ("*.js", "*.css", "*.html", "*.html.j2", "*.json")
LIMITS = {
    "package lines": 28_500, "test lines": 26_500, "Python files of the package": 230,
    "functions of more than 60 lines": 0, "functions of more than 8 parameters": 0, "complexity above 20": 0,
    "complexity above 15": 10, "modules of more than 300 lines": 0, "import circles": 0, "upward arrows": 0,
    "files from option to row": 20, "returns from option to row": 2, "types from view to row": 8,
}  # fmt: skip
COMMAND = r"\.(command|callback)\b"  # whose options are parameters, and whose help is a docstring
PLACED = 61  # --view-size of the walk: no other number there
Function = ast.FunctionDef | ast.AsyncFunctionDef


def lines_of(files: Iterable[Path]) -> dict[Path, int]:
    """Number of lines of each file."""
    return {file: len(file.read_text(encoding="utf-8").splitlines()) for file in sorted(files)}


def decorated(function: Function, pattern: str) -> bool:
    """Whether a decorator matches a pattern."""
    return any(re.search(pattern, ast.unparse(one)) for one in function.decorator_list)


def parameters(function: Function) -> int:
    """Number of parameters; 0 for a command, a public function of `api.py` and what Numba compiles."""
    names = {one.arg for one in ast.walk(function.args) if isinstance(one, ast.arg)}
    return 0 if decorated(function, rf"{COMMAND}|\bcompiled\b|njit\b") else len(names - {"self", "cls"})


def complexity(node: ast.AST) -> int:
    """Cyclomatic complexity, with boolean operators, comprehensions and inner functions counted, as radon has it."""

    def added(of: Any) -> int:
        if isinstance(of, ast.BoolOp):
            return len(of.values) - 1
        if isinstance(of, ast.comprehension):
            return 1 + len(of.ifs)
        if isinstance(of, ast.Try):
            return len(of.handlers) + bool(of.orelse)
        once = isinstance(of, Function | ast.If | ast.IfExp | ast.Assert | ast.Lambda | ast.match_case)
        return once + isinstance(of, ast.For | ast.While) * (1 + bool(getattr(of, "orelse", ())))

    return sum(map(added, ast.walk(node)))


def arrows(root: Path) -> list[tuple[str, str]]:
    """(importer, imported) modules of the package, also where imported in a function or for types only."""
    sys.path.insert(0, str(root))
    graph = grimp.build_graph("shadowbench", cache_dir=None)
    return sorted((one, other) for one in graph.modules for other in graph.find_modules_directly_imported_by(one))


def circles(edges: list[tuple[str, str]]) -> list[str]:
    """Sets of modules that import each other."""
    names = sorted({name for edge in edges for name in edge})
    matrix = np.zeros((len(names),) * 2)
    for one, other in edges:
        matrix[names.index(one), names.index(other)] = 1
    _, labels = connected_components(matrix, connection="strong")
    sets = [[name for name, of in zip(names, labels, strict=True) if of == label] for label in set(labels)]
    return [", ".join(names) for names in sets if len(names) > 1]


def upward(edges: list[tuple[str, str]], root: Path) -> list[str]:
    """Arrows from a layer of import-linter's contract to a higher one, or to a sibling that it must not know."""
    linter = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["importlinter"]
    layers = next(contract["layers"] for contract in linter["contracts"] if contract["type"] == "layers")
    of = {name: (level, "|" in text) for level, text in enumerate(layers) for name in re.split(r" [|:] ", text)}
    found = []
    for one, other in edges:
        room, other_room = (f"{name}.".split(".")[1] for name in (one, other))
        here, there = of.get(room), of.get(other_room)
        if room != other_room and here and there and (here[0] > there[0] or (here == there and here[1])):
            found.append(f"{one} -> {other}")
    return found


def twice(names: Mapping[str, Iterable[str]]) -> list[str]:
    """Names that stand in more than one place, with their places."""
    places = defaultdict(set)
    for place, own in names.items():
        for name in own:
            places[name].add(place)
    return [f"{name}: {', '.join(sorted(where))}" for name, where in sorted(places.items()) if len(where) > 1]


def walk(root: Path) -> dict[str, list[str]]:
    """Files, return steps and classes that hold `--view-size` on its way to the first row."""
    package, files, returns, types = f"{root}/shadowbench/", set[str](), set[str](), set[str]()

    def holds(value: Any, depth: int = 6) -> bool:
        if type(value) is int or depth == 0:
            return type(value) is int and value == PLACED
        own = type(value).__module__.startswith("shadowbench.")
        fields = getattr(value, "__dict__", {}) if own else value
        items = fields.values() if isinstance(fields, dict) else fields if isinstance(fields, list | tuple) else ()
        inside = max([holds(one, depth - 1) for one in list(items)[:64]], default=False)  # all are looked into
        if inside and own:
            types.add(f"{type(value).__module__}.{type(value).__qualname__}")
        return inside

    def follow(frame: Any, event: str, argument: Any) -> None:
        code = frame.f_code
        if not code.co_filename.startswith(package) or code.co_name.startswith("<") or event not in ("call", "return"):
            return
        names = code.co_varnames[: code.co_argcount + code.co_kwonlyargcount]
        given = [argument] if event == "return" else [frame.f_locals.get(name) for name in names]
        if any(isinstance(one, dict) and {"kind", "key", "status"} <= one.keys() for one in given):
            sys.setprofile(None)  # a row
        elif max([holds(one) for one in given], default=False):
            file = code.co_filename.removeprefix(package)
            files.add(file)
            caller = frame.f_back.f_code.co_filename if frame.f_back else ""
            if event == "return" and caller.startswith(package) and caller != code.co_filename:
                returns.add(f"{file} {code.co_qualname}")

    from shadowbench.commands import main

    with tempfile.TemporaryDirectory() as folder, open(os.devnull, "w") as null, redirect_stdout(null):
        os.environ["SHADOWBENCH_CACHE"] = folder  # the truth is traced
        sys.argv = ["shadowbench", "run", "post", "-t", "unshadowed", "--view-size", str(PLACED), "-o", f"{folder}/run"]
        sys.setprofile(follow)
        with suppress(SystemExit):
            main()
    walks = {"files from option to row": files, "returns from option to row": returns, "types from view to row": types}
    return {what: sorted(names) for what, names in walks.items()}


def counted(root: Path, with_walk: bool) -> Iterator[tuple[str, int, list[str]]]:
    """What is counted, how much of it, and which."""
    package = root / "shadowbench"
    modules, tests = lines_of(package.rglob("*.py")), lines_of((root / "tests").rglob("*.py"))
    own = modules | lines_of(file for pattern in PAGES for file in package.rglob(pattern))
    rooms = Counter[str]()
    for file, lines in own.items():
        rooms[(file.relative_to(package).parts[:-1] or ("(top)",))[0]] += lines
    yield "package lines", sum(own.values()), [f"{room} {lines}" for room, lines in sorted(rooms.items())]
    tables = lines_of((root / "tests").rglob("*.toml"))
    sums = {"test lines": sum(tests.values()), "lines of tests' tables": sum(tables.values())}
    yield from ((what, number, []) for what, number in (sums | {"Python files of the package": len(modules)}).items())
    trees = {str(file.relative_to(package)): ast.parse(file.read_text(encoding="utf-8")) for file in modules}
    each = [(file, one) for file, tree in trees.items() for one in ast.walk(tree) if isinstance(one, Function)]
    plain = [(file, one) for file, one in each if not decorated(one, COMMAND)]
    long = [f"{file} {one.name} {lines}" for file, one in plain if (lines := one.end_lineno - one.lineno + 1) > 60]
    yield "functions of more than 60 lines", len(long), long
    internal = [(file, one) for file, one in each if file != "api.py" or one.name[0] == "_"]
    many = [f"{file} {one.name} {count}" for file, one in internal if (count := parameters(one)) > 8]
    yield "functions of more than 8 parameters", len(many), many
    for limit in (20, 15):
        above = [f"{file} {one.name} {how}" for file, one in plain if (how := complexity(one)) > limit]
        yield f"complexity above {limit}", len(above), above
    big = [f"{file.relative_to(package)} {lines}" for file, lines in modules.items() if lines > 300]
    yield "modules of more than 300 lines", len(big), big
    edges = arrows(root)
    files = {file: [Path(file).name] for file in trees if Path(file).name != "__init__.py"}
    public = {
        file: [one.name for one in tree.body if isinstance(one, Function | ast.ClassDef) and one.name[0] != "_"]
        for file, tree in trees.items()
    }
    found = {"import circles": circles(edges), "upward arrows": upward(edges, root)}
    found |= {"file names that stand twice": twice(files), "public names that stand twice": twice(public)}
    for what, which in (found | (walk(root) if with_walk else {})).items():
        yield what, len(which), which


def main() -> None:
    """Run the command."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("checkout", nargs="?", type=Path, default=Path(__file__).resolve().parent.parent)
    parser.add_argument("--walk", action="store_true", help="also follow an option's value to its row")
    options = parser.parse_args()
    for what, number, which in counted(options.checkout.resolve(), options.walk):
        limit = LIMITS.get(what)
        over = "" if limit is None else f"  (limit {limit}: {f'{number - limit} over' if number > limit else 'kept'})"
        print(f"{what}: {number}{over}", *which, sep="\n    ")


if __name__ == "__main__":
    main()
