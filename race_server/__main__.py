"""``python -m race_server`` is ``race``."""

from race_server.cli.main import main

main()
