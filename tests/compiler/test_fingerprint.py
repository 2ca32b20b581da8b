"""What decides which machine code is made: versions, settings, sources and processor, told without the compiler."""

import configparser
import inspect
import re
import shutil
import sys

import llvmlite
import llvmlite.binding as llvm
import numba
import numba.core.config
import pytest
from helpers.raster import ROOT
from helpers.stores import run

from rasterizer.compiler import fingerprint
from rasterizer.compiler.fingerprint import PROCESSOR_LEVELS

FOLDER = "from rasterizer.compiler.kernels import STORE; print(STORE.own.name)"

# ---------------------------------------------------------------- versions


def requirement(package) -> str:
    setup = configparser.ConfigParser()
    setup.read(ROOT / "setup.cfg")
    (line,) = re.findall(rf"^{package}.*$", setup["options"]["install_requires"], re.MULTILINE)
    return line


def test_the_versions_that_may_be_installed_are_those_that_were_seen():
    (first, last) = fingerprint.SEEN
    assert requirement("numba") == f"numba>={first[0]}.{first[1]},<{last[0]}.{last[1] + 1}"
    assert fingerprint.is_seen(numba.__version__)


def test_llvmlite_is_declared_with_the_versions_that_come_with_numba():
    """Numba 0.61 brings llvmlite 0.44, and 0.68 brings 0.50."""
    assert requirement("llvmlite") == "llvmlite>=0.44,<0.51"
    major, minor, *_ = map(int, re.findall(r"\d+", llvmlite.__version__))
    assert major == 0 and 44 <= minor <= 50


@pytest.mark.parametrize("version", ["0.61.0", "0.61.2", "0.65.0rc1", "0.68.1", "0.68.9+4.gabc"])
def test_versions_that_were_seen(version):
    assert fingerprint.is_seen(version)


@pytest.mark.parametrize("version", ["0.60.9", "0.69.0", "0.69.0dev0", "0.100.0", "1.61.0", "1.0", "0+unknown", ""])
def test_versions_that_were_not_seen(version):
    assert not fingerprint.is_seen(version)


def test_the_version_of_numba_is_known_without_importing_it(tmp_path):
    told = run(
        "import sys; from rasterizer.compiler.fingerprint import numba_version; print(numba_version())\n"
        "assert 'numba' not in sys.modules and 'importlib.metadata' not in sys.modules",
        tmp_path,
    )
    assert told == numba.__version__ == fingerprint.numba_version()


def test_without_numba_there_is_no_version(monkeypatch):
    monkeypatch.delitem(sys.modules, "numba")
    monkeypatch.setattr(fingerprint.importlib.util, "find_spec", lambda _name: None)
    assert fingerprint.numba_version() == ""


# ---------------------------------------------------------------- settings


@pytest.mark.parametrize("name", set(fingerprint.CODE_SETTINGS) - {"CPU_NAME", "CPU_FEATURES"})
def test_every_setting_that_changes_code_changes_what_describes_the_compiler(name, monkeypatch):
    monkeypatch.delenv(f"NUMBA_{name}", raising=False)
    before = fingerprint.describe_compiler()
    monkeypatch.setenv(f"NUMBA_{name}", "something else")
    assert fingerprint.describe_compiler() != before


def test_settings_in_a_file_change_what_describes_the_compiler(tmp_path, monkeypatch):
    """Numba reads it where the program is started."""
    monkeypatch.chdir(tmp_path)
    before = fingerprint.describe_compiler()
    (tmp_path / ".numba_config.yaml").write_text("opt: 0\n")
    assert fingerprint.describe_compiler() != before


def test_most_settings_are_known_to_this_version():
    """One that was renamed would no longer be seen to change."""
    source = inspect.getsource(numba.core.config)
    unknown = {name for name in fingerprint.CODE_SETTINGS if not re.search(rf"""["']NUMBA_{name}["']""", source)}
    optional = {"ENABLE_SYS_MONITORING", "EXTEND_VARIABLE_LIFETIMES", "USING_SVML"}  # not in every version
    assert unknown <= optional, f"{unknown} are no settings of numba {numba.__version__}"


def test_a_setting_of_0_is_none(monkeypatch):
    for value, expected in (("0", ""), ("1", "1"), ("", ""), (" 0 ", "")):
        monkeypatch.setenv("NUMBA_DISABLE_JIT", value)
        assert fingerprint.setting("DISABLE_JIT") == expected


def test_settings_that_change_code_have_kernels_of_their_own(tmp_path):
    settings = [{}, {"NUMBA_OPT": 0}, {"NUMBA_LOOP_VECTORIZE": 0}, {"NUMBA_DEBUGINFO": 1}, {"NUMBA_ENABLE_AVX": 0}]
    names = [run(FOLDER, tmp_path, RASTER_STORE=tmp_path / "kernels", **given) for given in settings]
    assert len(set(names)) == len(names), names
    assert run(FOLDER, tmp_path, RASTER_STORE=tmp_path / "kernels", NUMBA_NUM_THREADS=1) == names[0]


# ---------------------------------------------------------------- sources


def test_the_folder_depends_on_the_sources_of_kernels_and_on_nothing_else(tmp_path):
    """A helper that changed in any file must not meet kernels that were compiled with the old one."""
    package = tmp_path / "copy" / "rasterizer"
    shutil.copytree(ROOT / "rasterizer", package, ignore=shutil.ignore_patterns("__pycache__", "kernels"))

    def name():
        return run(FOLDER, tmp_path, RASTER_STORE=tmp_path / "store", PYTHONPATH=package.parent)

    first = name()
    assert first == run(FOLDER, tmp_path, RASTER_STORE=tmp_path / "store")
    (package / "options.py").open("a").write("\n# no kernel here\n")
    assert name() == first
    for changed in ("pipeline/simd.py", "pipeline/fragments.py", "geometry/creases.py", "compiler/kernels.py"):
        (package / changed).open("a").write("\n# changed\n")
        second = name()
        assert second != first, changed
        first = second


# ---------------------------------------------------------------- processors


def test_levels_hold_what_the_compiler_takes_them_for():
    """Each level has all of the ones below it, and those of LLVM have the same features."""
    names = sorted(PROCESSOR_LEVELS)
    for lower, higher in zip(names, names[1:], strict=False):
        assert set(PROCESSOR_LEVELS[lower]) < set(PROCESSOR_LEVELS[higher])
    assert list(PROCESSOR_LEVELS) == names[::-1], "the best one goes first"
    assert fingerprint.features_of("x86-64-v2") == "+cx16,+popcnt,+sahf,+sse3,+ssse3,+sse4.1,+sse4.2"


def processor_with(monkeypatch, features, **settings):
    """Let this machine's processor have some features."""
    for name in ("CPU_NAME", "CPU_FEATURES"):
        monkeypatch.delenv(f"NUMBA_{name}", raising=False)
    for name, value in settings.items():
        monkeypatch.setenv(f"NUMBA_{name}", value)
    map_of_features = llvm.FeatureMap(dict.fromkeys(features, True))
    monkeypatch.setattr(fingerprint.llvm, "get_host_cpu_features", lambda: map_of_features)
    monkeypatch.setattr(fingerprint.llvm, "get_host_cpu_name", lambda: "toy")
    return list(fingerprint.usable_processors())


def test_code_for_a_level_is_used_where_the_processor_can_do_all_of_it(monkeypatch):
    for level, features in PROCESSOR_LEVELS.items():
        reached = list(PROCESSOR_LEVELS)[list(PROCESSOR_LEVELS).index(level) :]
        assert processor_with(monkeypatch, features)[1:] == reached
        assert level not in processor_with(monkeypatch, features[:-1]), f"without {features[-1]}"
    (only,) = processor_with(monkeypatch, ())
    assert only == "toy "


def test_a_processor_that_is_asked_for_is_the_only_one(monkeypatch):
    every, level = PROCESSOR_LEVELS["x86-64-v4"], "x86-64-v3"
    features = fingerprint.features_of(level)
    assert processor_with(monkeypatch, every, CPU_NAME=level, CPU_FEATURES=features) == [level]
    assert processor_with(monkeypatch, every, CPU_NAME="generic", CPU_FEATURES="") == ["generic "]


def test_code_with_other_features_is_not_taken_for_that_of_a_level(monkeypatch):
    """It would be shipped to processors that can't run it."""
    every, level = PROCESSOR_LEVELS["x86-64-v4"], "x86-64-v3"
    for features in ("+avx512f", "", fingerprint.features_of("x86-64-v4")):
        assert processor_with(monkeypatch, every, CPU_NAME=level, CPU_FEATURES=features) == [f"{level} {features}"]
    (only,) = processor_with(monkeypatch, every, CPU_NAME=level)
    assert only.startswith(f"{level} +") and "avx512f" in only  # this machine's are taken where none are asked for


def test_features_that_are_asked_for_tell_this_processor_from_others(monkeypatch):
    every = PROCESSOR_LEVELS["x86-64-v4"]
    assert processor_with(monkeypatch, every, CPU_FEATURES="+sse3")[0] == "toy +sse3"
    assert processor_with(monkeypatch, every)[0] == "toy " + ",".join(f"+{name}" for name in sorted(every))
