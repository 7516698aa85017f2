"""Entry point of `python -m shadowbench`."""

from shadowbench.commands import main

main()
