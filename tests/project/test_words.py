"""One word, one meaning: the words that this field has are used, and the private ones that stood in their place are
not.

A cheap check of names and docstrings; what a word is for is said in rasterizer/README.md.
"""

import ast
import re
from typing import NamedTuple

import pytest
from helpers.imports import PATHS, TREES

RASTER = ("pipeline", "engine", "geometry", "reference")  # where a word has its meaning from the field


class Rule(NamedTuple):
    """A word that isn't used."""

    pattern: str  # of a whole word: of a docstring, or between the underscores and capitals of a name
    instead: str
    folders: tuple[str, ...] = ()  # where it isn't used; () = everywhere
    is_of_names: bool = True  # whether names are looked at, too
    is_of_texts: bool = True  # whether docstrings are
    exceptions: tuple[str, ...] = ()  # names, or parts of sentences, in which it is right


RULES = (
    Rule("canvas", "visibility buffer"),
    Rule("knee", "middle vertex"),
    Rule("matte", "diffuse"),
    Rule("shin(e|y)", "specular"),
    Rule("glow", "emission"),
    Rule("lifts?", "normal offset"),
    Rule("judges?", "reference"),
    Rule("jobs?", "pass", RASTER),
    Rule("bench|working place", "workspace",
         exceptions=("raster bench", "`bench` and", "bench_models", "_bench_model", "_add_bench", "BENCH")),
    Rule("held off", "occluded", is_of_names=False),
    Rule("layer peeling", "depth peeling", is_of_names=False),
    Rule("row functions?", "light function, reflection function", is_of_names=False),
    Rule("chunk", "batch", ("pipeline", "engine")),
    Rule("word", "visibility buffer entry", ("pipeline",)),
    Rule("take", "gather, evaluate, sample, decode", RASTER, is_of_texts=False),
    Rule("compose", "combine", RASTER, is_of_texts=False),
    Rule("places?", "say which: vertex, texel, texcoord, position", RASTER, is_of_texts=False),
)  # fmt: skip

# Functions whose name begins with find_ and that search: for what may not be there. Others compute.
FINDS = {
    "find_doubts", "find_distrust", "find_start", "find_hindrance", "find_entry_point", "find_rings",
    "find_shortest_normal", "find_colored",
    "find_alike", "find_materials", "find_crossing", "find_nearest", "find_topmost", "find_visible",
    "find_visible_in", "find_seen", "find_covered", "find_covered_samples", "find_fans", "find_loops",
    "find_small", "find_largest", "find_singly_assigned_variable",
}  # fmt: skip


def folder_of(module) -> str:
    return module.split(".")[0]


def names_of(tree) -> set[str]:
    """Names that a module gives: of classes, functions, parameters and variables."""
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, (ast.FunctionDef, ast.ClassDef)):
            found.add(node.name)
        elif isinstance(node, ast.arg):
            found.add(node.arg)
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            found.add(node.id)
    return found


def words_of(name) -> list[str]:
    """The words of a name: `light_dir` has two, `FaceTable` too."""
    return re.findall(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])", name)


def texts_of(tree) -> list[str]:
    """Docstrings of a module, its classes and its functions."""
    kinds = (ast.Module, ast.ClassDef, ast.FunctionDef)
    return [text for node in ast.walk(tree) if isinstance(node, kinds) and (text := ast.get_docstring(node))]


def found_in(rule, module) -> list[str]:
    """Where a module breaks a rule."""
    whole, found = re.compile(rf"(?:{rule.pattern})", re.IGNORECASE), []
    if rule.is_of_names:
        found += [
            name
            for name in names_of(TREES[module])
            if name not in rule.exceptions and any(whole.fullmatch(word) for word in words_of(name))
        ]
    if rule.is_of_texts:
        within = re.compile(rf"\b(?:{rule.pattern})\b", re.IGNORECASE)
        for text in texts_of(TREES[module]):
            for exception in rule.exceptions:
                text = text.replace(exception, "")
            found += [text[max(0, match.start() - 30) : match.end() + 20] for match in within.finditer(text)]
    return found


FOLDERS = sorted({folder_of(module) for module in PATHS})
PAIRS = [(rule, folder) for rule in RULES for folder in rule.folders or FOLDERS]


@pytest.mark.parametrize(("rule", "folder"), PAIRS, ids=lambda value: getattr(value, "pattern", value))
def test_the_word_of_the_field_is_used(rule, folder):
    modules = [module for module in PATHS if folder_of(module) == folder]
    found = {module: places for module in modules if (places := found_in(rule, module))}
    assert not found, f"use {rule.instead}"


@pytest.mark.parametrize("folder", FOLDERS)
def test_find_is_said_of_a_search_alone(folder):
    modules = [module for module in PATHS if folder_of(module) == folder]
    found = {node.name.lstrip("_") for module in modules for node in ast.walk(TREES[module]) if is_function(node)}
    finds = {name for name in found if name.startswith("find_")}
    assert not finds - FINDS, "say compute_, or enter it where searches are listed"


def test_searches_that_are_listed_exist():
    found = {node.name.lstrip("_") for tree in TREES.values() for node in ast.walk(tree) if is_function(node)}
    assert not FINDS - found, "these functions are gone"


def is_function(node) -> bool:
    return isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef))


def test_the_rules_find_what_they_look_for():
    tree = ast.parse(
        '"""Draws on the canvas, shiny and held off."""\ndef find_knee(canvas_rows, shininess):\n    pass\n'
    )
    TREES["sample"] = tree
    try:
        broken = {rule.pattern for rule in RULES if found_in(rule, "sample")}
    finally:
        del TREES["sample"]
    assert broken == {"canvas", "knee", "shin(e|y)", "held off"}
