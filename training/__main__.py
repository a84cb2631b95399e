"""`python -m training STAGE`: one stage of making the embedded model; `make train` runs them all."""

import sys

from training.command import main

if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
