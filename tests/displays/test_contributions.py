"""Contributions are drawn over the bins, beside the predicted fault orders."""

from matplotlib.figure import Figure

from emacm.displays import ContributionsDisplay

NAMES = ["current@3-4", "current@5-7", "vibration@3-4", "vibration@5-7"]


def axes(n_panels=1):
    return Figure(figsize=(7, 8)).subplots(n_panels, squeeze=False)[:, 0]


def bars(ax):
    return sorted((bar.get_x(), bar.get_width(), bar.get_height()) for bar in ax.patches)


def test_each_channel_has_bars_between_the_edges_of_its_bins():
    panels = axes(2)
    ContributionsDisplay(NAMES, [2.0, -1.0, 0.5, 0.0]).plot(ax=panels)
    assert bars(panels[0]) == [(3, 1, 2.0), (5, 2, -1.0)]
    assert bars(panels[1]) == [(3, 1, 0.5), (5, 2, 0.0)]
    assert panels[0].get_ylim() == panels[1].get_ylim()
    label = panels[0].get_ylabel().replace("\n", " ")
    assert label == "contribution of current [nats]"


def test_predicted_fault_orders_are_marked_and_set_beside_the_bins():
    panels = axes(2)
    orders = {"screw": 3.125, "BPFI": 6.123, "2 BPFI": 12.246}
    display = ContributionsDisplay(NAMES, [2.0, 0, 0, 1], fault_orders=orders).plot(ax=panels)
    assert [text.get_text() for text in panels[0].texts] == ["screw", "BPFI"]
    assert display.frame()["contribution"].tolist() == [2.0, 0, 0, 1]
