"""`python -m gentamp_lp` is the `gentamp-lp` command."""

from gentamp_lp.cli import main

main()
