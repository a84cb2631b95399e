"""Where the command begins: `logisticsvln`, or `python -m command_line`."""

import signal


def main() -> None:
    """Runs the command of this process's arguments, and ends the process."""
    # until a command is loaded there is nothing to put in order, and an interrupt may end the process at once
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    from command_line.main import app

    app(prog_name="logisticsvln")


if __name__ == "__main__":
    main()
