"""Published figures of the thesis, computed again: ``python -m emacm.thesis``.

- `reproduce`: all chapters, and a report that compares each published figure with ours.
- `reproduce_chapter2`, `reproduce_chapter3`, `reproduce_chapter4`: the results of one chapter.
- `run_campaign`, `study`: the tests of chapter 4 on the simulated bench, for studies beyond it.
"""

from emacm.thesis.chapter2 import reproduce_chapter2
from emacm.thesis.chapter3 import reproduce_chapter3
from emacm.thesis.chapter4 import reproduce_chapter4
from emacm.thesis.chapter4_spectra import Campaign, run_campaign
from emacm.thesis.chapter4_study import Study, study
from emacm.thesis.findings import Chapter, Finding
from emacm.thesis.reproduction import CHAPTERS, reproduce

__all__ = [
    "CHAPTERS",
    "Campaign",
    "Chapter",
    "Finding",
    "Study",
    "reproduce",
    "reproduce_chapter2",
    "reproduce_chapter3",
    "reproduce_chapter4",
    "run_campaign",
    "study",
]
