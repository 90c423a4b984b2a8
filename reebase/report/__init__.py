"""A report on how well shapes are retrieved: one page, its numbers as JSON, and its plots.

    report = Report("animals", (Entry("srg", "matching", evaluate(D, labels, names)),))
    for name, data in files(report).items():
        Path(out, name).write_bytes(data)

The page needs nothing but a browser: no script, no network. It compares descriptors as the thesis does (Kacem, Figure
4.15, Tables 4.1 and 4.2), and says for each what it costs. Plots need matplotlib (``reebase[pictures]``).
"""

from reebase.report.files import files, page
from reebase.report.lists import Row, sample_of, typical, worst
from reebase.report.record import Cost, Entry, Report

__all__ = ["Cost", "Entry", "Report", "Row", "files", "page", "sample_of", "typical", "worst"]
