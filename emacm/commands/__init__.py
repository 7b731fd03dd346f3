"""Commands of the command line on files: inspect, train, score."""
