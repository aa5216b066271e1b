"""``python -m atvrec``: the command ``atvrec``."""

from atvrec._program import main

if __name__ == "__main__":
    raise SystemExit(main())
