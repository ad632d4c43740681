"""Where the program `race` begins: quietly interrupted while its commands are still imported."""

import signal


def main() -> None:
    """Run the command line."""
    # An import takes half a second. A Ctrl-C in it would print where it was; it ends the process.
    held = signal.getsignal(signal.SIGINT)
    if held is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    from race_server.cli.main import main as run

    signal.signal(signal.SIGINT, held)
    run()
