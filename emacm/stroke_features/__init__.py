"""Named feature columns computed from strokes."""
