"""Published figures of the thesis, computed again: ``python -m emacm.thesis``.

- `reproduce`: all chapters, and a report that compares each published figure with ours.
- `reproduce_chapter2` to `reproduce_chapter5`: the results of one chapter.
- `run_campaign`, `study`, `shares_table`: the tests of chapter 4 on the simulated bench, and the
  orders that determine their decisions, for studies beyond the thesis.
"""

from emacm.thesis.chapter2 import reproduce_chapter2
from emacm.thesis.chapter3 import reproduce_chapter3
from emacm.thesis.chapter4 import reproduce_chapter4
from emacm.thesis.chapter4_spectra import SIGNALS, Campaign, run_campaign
from emacm.thesis.chapter4_study import Study, study
from emacm.thesis.chapter4_tables import shares_table
from emacm.thesis.chapter5 import reproduce_chapter5
from emacm.thesis.findings import Chapter, Finding
from emacm.thesis.reproduction import CHAPTERS, reproduce

__all__ = [
    "CHAPTERS",
    "SIGNALS",
    "Campaign",
    "Chapter",
    "Finding",
    "Study",
    "reproduce",
    "reproduce_chapter2",
    "reproduce_chapter3",
    "reproduce_chapter4",
    "reproduce_chapter5",
    "run_campaign",
    "shares_table",
    "study",
]
