"""`python -m training`: make the embedded model, or one stage of it. `--help` says which."""

import sys

from training.command import main

if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
