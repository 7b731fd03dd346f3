"""Performance on recordings held out by run, by unit and by condition."""
