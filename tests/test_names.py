"""Names of the package: imported when they are used, and the same for readers, type checkers and programs."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import contbranch

PACKAGES = ("", "contact", "models/axisymmetric", "models/exact", "models/grid")


@pytest.mark.parametrize("package", PACKAGES)
def test_type_checkers_see_what_programs_import(package: str) -> None:
    """The imports under TYPE_CHECKING are those that happen: the same names, from the same modules."""
    name = ".".join(["contbranch", *filter(None, package.split("/"))])
    source = (Path(contbranch.__file__).parent / package / "__init__.py").read_text(encoding="utf-8")
    checked = next(node for node in ast.parse(source).body if isinstance(node, ast.If))
    seen = {alias.name: node.module for node in checked.body for alias in node.names}
    module = sys.modules.get(name) or __import__(name, fromlist=["_"])
    assert sorted(seen) == sorted(module.__all__)
    assert set(seen) <= set(dir(module))
    for alias, home in seen.items():
        assert getattr(module, alias) is getattr(__import__(home, fromlist=["_"]), alias)
    with pytest.raises(AttributeError, match="has no attribute 'nonsense'"):
        _ = module.nonsense


def test_importing_the_package_imports_no_library() -> None:
    code = (
        "import sys, contbranch as cb; assert not {'numpy', 'scipy', 'pint', 'matplotlib', 'h5py'} & set(sys.modules); "
        "cb.Contact.reduced('gauss'); assert not {'pint', 'matplotlib', 'scipy.interpolate'} & set(sys.modules); "
        "cb.theory; from contbranch import *; assert Periodic.name == 'periodic'"
    )
    subprocess.run([sys.executable, "-c", code], check=True, timeout=60)
