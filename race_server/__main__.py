"""``python -m race_server`` is ``race``."""

from race_server.cli.entry import main

main()
