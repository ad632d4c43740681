"""Shows the timing of a race in a terminal, from the JSON of its gateway alone.

    python examples/timing_board.py http://127.0.0.1:8080 [TOKEN]

It needs Python's own library and nothing of the race server.
"""

import http.client
import json
import signal
import sys
import time
import urllib.error
import urllib.request

COLOURS = {"best": "\033[95m", "own_best": "\033[92m", "slower": "\033[93m", "none": "\033[90m"}
RESET, CLEAR = "\033[0m", "\033[2J\033[H"


def ask(address: str, token: str) -> dict | None:
    """Return the table, or None while no race is there."""
    headers = {"Authorization": f"Bearer {token}"} if token else {}
    request = urllib.request.Request(f"{address.rstrip('/')}/timing", headers=headers)
    try:
        with urllib.request.urlopen(request, timeout=5) as answer:
            return json.load(answer)
    except urllib.error.HTTPError as error:
        if error.code == 503:
            return None
        raise


def seconds(us: int) -> str:
    """Return a time, nothing for one that there is not."""
    return f"{us / 1e6:.3f}" if us else ""


def printable(text: str) -> str:
    """Return a name without what a terminal would take as an order."""
    return "".join(sign if sign.isprintable() else "?" for sign in text)


def line(row: dict) -> str:
    """Return a row of the board."""
    timing = row.get("timing", {})
    down = timing.get("laps_down", 0)
    minis = "".join(f"{COLOURS[merit]}▪" for merit in timing.get("mini_merits", ())) + RESET
    numbers = [
        f"+{down} LAP" if down else seconds(row["gap_us"]),
        seconds(timing.get("interval_us", 0)),
        seconds(row["last_lap_us"]),
        seconds(row["best_lap_us"]),
    ]
    name = f"{row['rank']:>2} {printable(row['driver']):<20.20}"
    return name + "".join(f"{number:>10}" for number in numbers) + f"  {minis}"


def show(table: dict) -> None:
    """Print the board over the last one."""
    names = "".join(f"{name:>10}" for name in ("gap", "interval", "last", "best"))
    head = f"   {printable(table['course']):<20.20}{names}"
    print(CLEAR + head, *map(line, table["rows"]), sep="\n", flush=True)


def main() -> None:
    """Show the board until the race is over."""
    if hasattr(signal, "SIGPIPE"):
        signal.signal(signal.SIGPIPE, signal.SIG_DFL)  # end quietly with the reader of a pipe
    address = sys.argv[1] if len(sys.argv) > 1 else "http://127.0.0.1:8080"
    token = sys.argv[2] if len(sys.argv) > 2 else ""
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # and with Ctrl-C
    while True:
        try:
            table = ask(address, token)
        except (OSError, http.client.HTTPException, ValueError) as error:
            sys.exit(
                f"error: {address}: no timing ({printable(str(error))}); give the address of a "
                "gateway, such as http://127.0.0.1:8080, and its token if it asks for one"
            )
        if table is None:
            print("no race yet")
        else:
            show(table)
            if table["phase"] == "finished":
                return
        time.sleep(0.5)


if __name__ == "__main__":
    main()
