"""The command as a module: ``python -m contbranch``."""

from contbranch.cli import main

if __name__ == "__main__":
    raise SystemExit(main())
