"""Base class of transformers that return recordings: names of channels, and no output table."""

from __future__ import annotations

from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray
from sklearn.base import TransformerMixin
from sklearn.utils.validation import check_is_fitted

from emacm._saved import SavedEstimator

Self = TypeVar("Self", bound="RecordingTransformer")


class RecordingTransformer(  # type: ignore[call-arg]
    TransformerMixin, SavedEstimator, auto_wrap_output_keys=None
):
    """Base of transformers from recordings to recordings.

    Subclasses learn `channels_`, and state ``auto_wrap_output_keys=None`` as well, since
    scikit-learn asks each class by itself whether to make tables of what it returns.
    """

    channels_: tuple[str, ...]

    def get_feature_names_out(self, input_features: Any = None) -> NDArray[np.object_]:
        """Return the names of the channels.

        Parameters
        ----------
        input_features : ignored
            Recordings name their own channels.

        Returns
        -------
        ndarray of str
        """
        check_is_fitted(self)
        return np.array(self.channels_, dtype=object)

    def set_output(self: Self, *, transform: str | None = None) -> Self:
        """Accept the option of `Pipeline.set_output`; it has no effect on recordings.

        Parameters
        ----------
        transform : {"default", "pandas", "polars", None}
            Has no effect here.

        Returns
        -------
        RecordingTransformer
            Itself.
        """
        return self

    def __sklearn_tags__(self) -> Any:
        """Tell scikit-learn that X is no 2-D table."""
        tags = super().__sklearn_tags__()
        tags.input_tags.two_d_array = False
        return tags
