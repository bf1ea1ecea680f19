"""`python -m graspsense` is `graspsense`."""

from graspsense.cli.entry import main

main()
