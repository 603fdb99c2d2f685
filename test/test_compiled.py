"""Kernels are compiled when they are first called, and numba is imported then: most commands call none."""

from __future__ import annotations

import math
import os
import subprocess
import sys
import textwrap
from pathlib import Path

import numpy as np
import pytest

from etac_ros.maths.compiled import _use_cache_folder, kernel
from etac_ros.maths.vector import cross
from etac_ros.plants import flexible, manoeuvre, pm_sm, rigid, rigid_mrp

ROOT = Path(__file__).resolve().parents[1]


def python(script: str, *folders: Path) -> str:
    """What a fresh interpreter prints."""
    paths = ":".join(map(str, folders))
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(script)], capture_output=True, text=True, env={"PYTHONPATH": paths},
        check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.parametrize("command", [["list"], ["--help"], ["list", "qi2022"], ["resolve", "xie2021"]])
def test_commands_that_run_nothing_import_no_numba(command: list[str]) -> None:
    script = f"""
        import sys
        sys.argv = ["etac", *{command!r}]
        from etac_ros.cli.main import main
        try:
            main()
        except SystemExit as end:
            assert not end.code, end.code
        sys.stdout.flush()
        print("numba" in sys.modules)
    """
    assert python(script).splitlines()[-1] == "False"


def test_a_kernel_gives_what_its_function_gives() -> None:
    calls = []

    def summed(values):  # type: ignore[no-untyped-def]
        calls.append(1)  # what is compiled has no such list
        return values.sum()

    def plain(values):  # type: ignore[no-untyped-def]
        out = np.empty(3)
        cross(values[0], values[1], out)
        return out

    values = np.array([[1.0, 2.0, 3.0], [-1.0, 0.5, 2.0]])
    assert np.array_equal(kernel(plain)(values), np.cross(values[0], values[1]))
    with pytest.raises(Exception, match="calls"):
        kernel(summed)(values)
    assert not calls


def test_a_users_class_may_compile_with_numba_itself_and_call_functions_of_ours(tmp_path: Path) -> None:
    (tmp_path / "own_kernel.py").write_text(
        textwrap.dedent(
            """
            import numpy as np
            from etac_ros.maths.vector import cross
            import numba

            @numba.njit
            def turned(a, b):
                out = np.empty(3)
                cross(a, b, out)
                return out

            class Parameters:
                pass
            """
        )
    )
    script = """
        import numpy as np
        from etac_ros.scenario.classes import import_class
        import_class("own_kernel:Parameters", "here")
        import own_kernel
        print(own_kernel.turned(np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])).tolist())
    """
    assert python(script, tmp_path).strip() == "[0.0, 0.0, 1.0]"


def test_kernels_of_plants_have_names_of_their_own() -> None:
    """Symbols of cached machine code are made of them: alike, they get in each other's way once both are loaded."""
    plants = (rigid, rigid_mrp, pm_sm, flexible, manoeuvre)
    names = {plant._propagate.name for plant in plants}
    assert len(names) == len(plants)


def test_cached_machine_code_is_loaded_without_the_compiler(tmp_path: Path) -> None:
    (tmp_path / "some_kernel.py").write_text(
        textwrap.dedent(
            """
            import numpy as np
            from etac_ros.maths.compiled import kernel

            @kernel
            def formed(a, b):
                if b[0] > 1e9:
                    raise ValueError("too large")
                return np.tanh(a[0, 0] * b[0]), np.empty(2)
            """
        )
    )
    script = f"""
        import os, sys
        os.environ["NUMBA_CACHE_DIR"] = {str(tmp_path / "cache")!r}
        import numpy as np
        from some_kernel import formed
        value, made = formed(np.eye(3), np.array([0.5, 0.25, 2.0]))
        print(value, made.shape)
        try:
            formed(np.eye(3), np.full(3, 1e10))
        except ValueError as error:
            print(error)
        print("numba.np.arraymath" in sys.modules)
    """
    compiled, loaded = (python(script, tmp_path).splitlines() for _ in range(2))
    assert compiled == [f"{math.tanh(0.5)} (2,)", "too large", "True"]
    assert loaded == [*compiled[:2], "False"]


def test_a_user_without_a_home_has_a_cache_all_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    def home() -> Path:
        raise RuntimeError("Could not determine home directory.")

    for name in ("NUMBA_CACHE_DIR", "XDG_CACHE_HOME"):
        monkeypatch.delenv(name, raising=False)
    config = pytest.importorskip("numba.core.config")
    monkeypatch.setattr(config, "CACHE_DIR", config.CACHE_DIR)
    monkeypatch.setattr(Path, "home", home)
    _use_cache_folder.__wrapped__()
    assert str(os.getuid()) in config.CACHE_DIR
