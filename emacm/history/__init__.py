"""Records of decisions, the states of alarms, and where they are kept or sent to."""
