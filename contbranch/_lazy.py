"""Names of a package that are imported when they are first used (PEP 562), so that a program starts quickly."""

from __future__ import annotations

import sys

TYPE_CHECKING = False  # of `typing`, which takes as long to import as everything else here
if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from typing import Any


def lazily(package: str, homes: Mapping[str, str]) -> tuple[Callable[[str], Any], Callable[[], list[str]], list[str]]:
    """Return ``__getattr__``, ``__dir__`` and ``__all__`` of a package whose names come from other modules.

    Parameters
    ----------
    package : str
        Its ``__name__``.
    homes : mapping
        Names, separated by blanks, by the module that they come from, relative to the package; none: the module.
    """
    where = {name: module for module, names in homes.items() for name in names.split()}
    modules = {module.rpartition(".")[2]: module for module, names in homes.items() if not names}

    def __getattr__(name: str) -> Any:
        from importlib import import_module

        if name in modules:
            return import_module(modules[name], package)
        if name not in where:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        value = getattr(import_module(where[name], package), name)
        setattr(sys.modules[package], name, value)
        return value

    def __dir__() -> list[str]:
        return sorted({*vars(sys.modules[package]), *where, *modules})

    return __getattr__, __dir__, sorted(where)
