"""Decision regions are the decisions of the classifier."""

import numpy as np
from matplotlib.colors import to_hex
from matplotlib.path import Path

from emacm import CostSensitiveGaussianBayes
from emacm.displays import DecisionRegionsDisplay
from emacm.displays.drawing import tint


def areas(ax):
    """Return the filled areas, in the order of the decisions."""
    return [drawn for drawn in ax.collections if getattr(drawn, "filled", False)]


def test_the_unknown_state_is_drawn_in_grey_around_the_recordings(ax):
    rng = np.random.default_rng(5)
    points = rng.normal(size=(60, 2)) * [1, 30] + np.repeat([[0, 0], [7, 0], [0, 200]], 20, axis=0)
    truths = np.repeat(["worn", "healthy", "dry"], 20)
    cost = {("inspect", truth): 0.3 for truth in ("worn", "healthy", "dry")}
    cost["inspect", "novel"] = 0.6
    model = CostSensitiveGaussianBayes(cost, unknown="novel", covariance="tied")
    model.fit(points, truths, groups=np.arange(60) % 10)
    display = DecisionRegionsDisplay.from_estimator(model, points, truths, n_grid=60, ax=ax)
    low, high = ax.get_xlim()
    width = np.ptp(points[:, 0])
    assert np.allclose([low, high], [points[:, 0].min() - width, points[:, 0].max() + width])
    decided = {display.decisions[code] for code in display.regions.ravel()}
    assert decided == {"healthy", "worn", "dry", "novel", "inspect"}
    labels = [text.get_text() for text in ax.get_legend().get_texts()]
    assert labels == ["healthy", "dry", "worn", "novel", "inspect"]
    patches = dict(zip(display.decisions, ax.patches, strict=True))
    unknown = to_hex(patches["novel"].get_facecolor())
    assert unknown == tint("#555555", 0.22)
    assert unknown not in {to_hex(patches[n].get_facecolor()) for n in ("inspect", "healthy")}
    drawn = areas(ax)[display.decisions.index("novel")]
    for x, y in [(display.first[-2], display.second[-2]), (0.0, 100.0), tuple(points[0])]:
        rings = [Path(ring) for path in drawn.get_paths() for ring in path.to_polygons()]
        inside = sum(ring.contains_point((x, y)) for ring in rings) % 2  # a hole has two rings
        assert inside == (model.predict([[x, y]])[0] == "novel")
    assert model.predict([[display.first[-2], display.second[-2]]])[0] == "novel"
