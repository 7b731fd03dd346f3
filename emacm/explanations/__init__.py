"""The orders and features that determine a decision."""
