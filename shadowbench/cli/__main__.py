"""`python -m shadowbench.cli`."""

from shadowbench.cli import main

main()
