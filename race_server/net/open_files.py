"""How many files this process may have open."""

import resource


def raise_open_files(wanted: int) -> int:
    """Ask for more open files, and return how many this process may have open.

    Often a process has 1024 until it asks for more. What it has already is never lowered.
    """
    files, most = resource.getrlimit(resource.RLIMIT_NOFILE)
    if files == resource.RLIM_INFINITY:
        return wanted
    may = wanted if most == resource.RLIM_INFINITY else min(most, wanted)
    files = max(files, may)
    resource.setrlimit(resource.RLIMIT_NOFILE, (files, most))
    return files
