"""``python -m atvrec``: the command ``atvrec``."""

from atvrec._program import main

raise SystemExit(main())
