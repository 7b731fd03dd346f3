"""Components of a machine and the orders at which their faults appear."""
