"""`python -m graspsense` is `graspsense`."""

from graspsense.cli.main import main

main()
