"""The command ``emacm alarms``: the alarms of a history, and who has taken care of them."""

from __future__ import annotations

import argparse

import pandas as pd

from emacm.history.records import ALARM, utc
from emacm.history.sqlite_history import History


def run(options: argparse.Namespace) -> int:
    """Set the state of an alarm, if that is wanted, and print the alarms.

    Returns
    -------
    int
        0; 1 if an alarm is raised, and neither acknowledged nor suppressed.

    Raises
    ------
    ValueError
        If no open alarm has the identity.
    """
    history = History(options.history)
    for identity, state in ((options.ack, "acknowledged"), (options.suppress, "suppressed")):
        now = utc(pd.Timestamp.now("UTC"))
        if identity and not history.set_state(identity, state, by=options.by, time=str(now)):
            known = [alarm["id"] for alarm in history.alarms(open_only=True)]
            raise ValueError(
                f"{options.history} has no open alarm {identity!r}; the open ones are {known}."
            )
    alarms = history.alarms(open_only=not options.all)
    history.close()
    if alarms:
        print(pd.DataFrame(alarms, columns=[*ALARM["properties"]]).to_string(index=False))
    else:
        print("There are no alarms." if options.all else "There are no open alarms.")
    return 1 if any(alarm["state"] == "raised" for alarm in alarms) else 0
