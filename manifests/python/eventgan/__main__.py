"""The program: `python3 -m eventgan ...`, and the command `eventgan` that pip makes of a wheel with the program."""

from __future__ import annotations

import os
import sys


def main() -> None:
    """Becomes the program, which gets this process's arguments."""
    program = os.path.join(os.path.dirname(__file__), "bin", "eventgan")
    if not os.path.exists(program):
        from .program import find_program  # takes a while to load
        try:
            program = find_program()
        except FileNotFoundError as error:
            sys.exit(f"error: {error}")
    os.execv(program, [program, *sys.argv[1:]])


if __name__ == "__main__":
    main()
