"""What decides which machine code is made: versions, settings, sources and processor, told without the compiler."""

import configparser
import importlib.util
import os
import platform
import re
import shutil

import llvmlite
import llvmlite.binding as llvm
import numba
import numpy as np
from helpers.raster import ROOT

from rasterizer.compiler import fingerprint, store
from rasterizer.compiler.fingerprint import PROCESSOR_LEVELS

# ---------------------------------------------------------------- versions


def test_the_versions_that_are_installed_and_the_first_that_may_be_were_seen():
    """Numba 0.61 brings llvmlite 0.44."""
    setup = configparser.ConfigParser()
    setup.read(ROOT / "setup.cfg")
    required = setup["options"]["install_requires"].split("\n")
    (first, (major, last)) = fingerprint.SEEN
    assert f"numba>={first[0]}.{first[1]},<{major}.{last + 1}" in required and "llvmlite>=0.44" in required
    major, minor, *_ = map(int, re.findall(r"\d+", llvmlite.__version__))
    assert fingerprint.is_seen(numba.__version__) and major == 0 and 44 <= minor <= 50


def test_versions_are_seen_or_not():
    for version in ("0.61.0", "0.61.2", "0.65.0rc1", "0.68.1", "0.68.9+4.gabc"):
        assert fingerprint.is_seen(version), version
    for version in ("0.60.9", "0.69.0", "0.69.0dev0", "0.100.0", "1.61.0", "1.0", "0+unknown", ""):
        assert not fingerprint.is_seen(version), version


# ---------------------------------------------------------------- settings and sources


def test_every_setting_that_changes_code_has_kernels_of_its_own(monkeypatch, tmp_path):
    """In the environment, or in a file that numba reads where the program is started."""
    monkeypatch.chdir(tmp_path)
    names = [name for name in fingerprint.CODE_SETTINGS if name not in ("CPU_NAME", "CPU_FEATURES")]
    assert {"OPT", "LOOP_VECTORIZE", "SLP_VECTORIZE", "DEBUGINFO", "ENABLE_AVX", "BOUNDSCHECK"} <= set(names)
    for name in fingerprint.CODE_SETTINGS:
        monkeypatch.delenv(f"NUMBA_{name}", raising=False)
    found = {"none": fingerprint.hash_sources("")}
    for name in names:
        with monkeypatch.context() as patch:
            patch.setenv(f"NUMBA_{name}", "something else")
            found[name] = fingerprint.hash_sources("")
    for name in ("NUMBA_NUM_THREADS", "NUMBA_CPU_NAME", "NUMBA_CPU_FEATURES"):  # the last two are in a kernel's key
        with monkeypatch.context() as patch:
            patch.setenv(name, "1")
            assert fingerprint.hash_sources("") == found["none"], name
    (tmp_path / ".numba_config.yaml").write_text("opt: 0\n")
    found["a file"] = fingerprint.hash_sources("")
    alike = [name for name, digits in found.items() if list(found.values()).count(digits) > 1]
    assert not alike, f"{alike} have the same kernels"


def test_a_store_that_is_shipped_is_for_all_versions_and_for_one_layout_of_objects(monkeypatch):
    own, shipped = store.own_name(), store.shipped_name()
    with monkeypatch.context() as patch:
        patch.setattr(numba, "__version__", "0.61.0")
        patch.setattr(np, "__version__", "2.0.0")
        assert store.own_name() != own and store.shipped_name() == shipped
    for name, value in (("machine", lambda: "another"), ("system", platform.system)):
        with monkeypatch.context() as patch:
            patch.setattr(platform, name, value)
            assert (store.shipped_name() == shipped) == (name == "system")
    with monkeypatch.context() as patch:  # free-threaded and debugging builds of one version, which have one cache tag
        patch.setattr(fingerprint, "describe_layouts", lambda: "another")
        assert store.own_name() != own and store.shipped_name() != shipped
    monkeypatch.setenv("NUMBA_OPT", "0")
    assert store.shipped_name() != shipped, "who asks for other code gets no code of others"


def test_a_setting_of_0_is_none(monkeypatch):
    for value, expected in (("0", ""), ("1", "1"), ("", ""), (" 0 ", "")):
        monkeypatch.setenv("NUMBA_DISABLE_JIT", value)
        assert fingerprint.setting("DISABLE_JIT") == expected


def test_the_folder_depends_on_every_source_of_kernels_and_on_nothing_else(tmp_path):
    """A helper that changed in any file must not meet kernels that were compiled with the old one."""
    package = tmp_path / "rasterizer"
    shutil.copytree(ROOT / "rasterizer", package, ignore=shutil.ignore_patterns("__pycache__", "kernels"))
    spec = importlib.util.spec_from_file_location("rasterizer.compiler.other", package / "compiler" / "fingerprint.py")
    copy = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(copy)
    known = copy.hash_sources("")
    assert known == fingerprint.hash_sources("")
    decorates = re.compile(r"^@(?:\w+\.)?(?:kernel|helper|spelled_out)\b", re.MULTILINE)
    names = "kernels.py", "internals.py", "layouts.py", "entry_points.py", "short_passes.py"
    own = {package / "pipeline" / "intrinsics.py", *(package / "compiler" / name for name in names)}
    n_source = 0
    for path in sorted(package.rglob("*.py")):
        text = path.read_text(encoding="utf-8")
        has_kernels = path in own or decorates.search(text) is not None
        if has_kernels or path.name in ("options.py", "renderer.py", "store.py"):
            path.write_text(f"{text}\n# changed\n", encoding="utf-8")
            found, known = known, copy.hash_sources("")
            assert (found != known) == has_kernels, path.relative_to(package)
            n_source += has_kernels
    assert n_source > 30, f"only {n_source} files with kernels were found <= 30"


# ---------------------------------------------------------------- processors


def processor_with(monkeypatch, features, **settings):
    """Let this machine's processor have some features."""
    for name in [name for name in os.environ if name.startswith("NUMBA_CPU_")]:
        monkeypatch.delenv(name)
    for name, value in settings.items():
        monkeypatch.setenv(f"NUMBA_{name}", value)
    map_of_features = llvm.FeatureMap(dict.fromkeys(features, True))
    monkeypatch.setattr(platform, "machine", lambda: "toy")  # LLVM is asked
    monkeypatch.setattr(llvm, "get_host_cpu_features", lambda: map_of_features)
    monkeypatch.setattr(llvm, "get_host_cpu_name", lambda: "toy")
    return list(fingerprint.usable_processors())


def test_code_for_a_level_is_used_where_the_processor_can_do_all_of_it(monkeypatch):
    for level, features in PROCESSOR_LEVELS.items():
        reached = list(PROCESSOR_LEVELS)[list(PROCESSOR_LEVELS).index(level) :]
        assert processor_with(monkeypatch, features)[1:] == reached
        for feature in features:
            others = [each for each in features if each != feature]
            assert level not in processor_with(monkeypatch, others), f"{level} without {feature}"
    assert processor_with(monkeypatch, ()) == ["toy ", "generic"], "all processors run what is for any"


def test_a_processor_or_features_that_are_asked_for_are_the_only_ones(monkeypatch):
    """Code with other features is not taken for that of a level: it would be shipped to those that can't run it."""
    every, level = (*PROCESSOR_LEVELS["x86-64-v3"], "avx512f"), "x86-64-v3"
    features = fingerprint.features_of(level)
    assert processor_with(monkeypatch, every, CPU_NAME=level, CPU_FEATURES=features) == [level]
    assert processor_with(monkeypatch, every, CPU_NAME="generic", CPU_FEATURES="") == ["generic"]
    for features in ("+avx512f", "", fingerprint.features_of("x86-64-v2")):
        assert processor_with(monkeypatch, every, CPU_NAME=level, CPU_FEATURES=features) == [f"{level} {features}"]
    (only,) = processor_with(monkeypatch, every, CPU_NAME=level)
    assert only.startswith(f"{level} ") and "avx512f" in only  # this machine's are taken where none are asked for
    assert processor_with(monkeypatch, every, CPU_FEATURES="+sse3")[0] == "toy +sse3"
    assert processor_with(monkeypatch, every)[0] == "toy " + ",".join(sorted(every))
