"""The items of the game: one file each, found by name.

A module in this folder that holds an `ITEM` is an item; nothing else has to be changed. Numbers
are given in alphabetical order from 1, so that 0 means no item.
"""

import importlib
import pkgutil
from functools import cache

import numpy as np

from race_server.core.rules.items.item import Item, item_records
from race_server.core.state import Records

__all__ = ["Item", "item_table", "items"]


@cache
def items() -> tuple[Item, ...]:
    """Return all items; the first has number 1."""
    found = []
    for entry in sorted(pkgutil.iter_modules(__path__), key=lambda entry: entry.name):
        module = importlib.import_module(f"{__name__}.{entry.name}")
        item = getattr(module, "ITEM", None)
        if isinstance(item, Item):
            found.append(item)
    return tuple(found)


def item_table() -> Records:
    """Return the items as the kernels read them, shape (items + 1,); row 0 is no item."""
    return np.concatenate([item_records([Item.nothing()]), item_records(items())])
