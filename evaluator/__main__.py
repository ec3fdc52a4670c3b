"""`python -m evaluator` is the `tsttc` command."""

from evaluator.cli import main

main(prog_name="tsttc")
