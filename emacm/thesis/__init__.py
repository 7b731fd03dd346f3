"""The figures of the thesis, computed anew beside the published ones."""
