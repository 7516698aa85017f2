"""`python -m shadowbench`."""

from shadowbench.commands import main

main()
