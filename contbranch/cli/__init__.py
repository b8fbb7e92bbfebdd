"""The command ``contbranch``."""

from contbranch.cli.commands import main

__all__ = ["main"]
