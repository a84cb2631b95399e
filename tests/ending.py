"""Programs that tests start do not outlive the tests, however these end: the kernel sees to it."""

WITH_THE_TESTS = ("setpriv", "--pdeathsig", "KILL", "--")
"""Before a command: its process is killed when the one that started it has ended. `setpriv` is of util-linux."""
