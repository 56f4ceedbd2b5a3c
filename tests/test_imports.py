"""The modules of the package and of the tools import each other in one direction."""

import grimp


def circles(graph):
    """Return the groups of modules that import each other, directly or through others."""
    return [
        {module, other}
        for module in graph.modules
        for other in graph.find_modules_directly_imported_by(module)
        if graph.find_shortest_chain(other, module)
    ]


def test_no_modules_import_each_other():
    """Imports for types only count too: what needs the type of another module depends on it."""
    graph = grimp.build_graph(
        "veca_marl", "tools", exclude_type_checking_imports=False, cache_dir=None
    )
    assert len(graph.modules) > 200
    assert circles(graph) == []


def test_a_circle_is_found():
    graph = grimp.ImportGraph()
    for importer, imported in (("a", "b"), ("b", "c"), ("c", "a"), ("c", "d")):
        graph.add_import(importer=importer, imported=imported)
    assert {frozenset(circle) for circle in circles(graph)} == {
        frozenset("ab"),
        frozenset("bc"),
        frozenset("ca"),
    }
