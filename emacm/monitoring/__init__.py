"""Continuous monitoring: streams, alarms, trends and remaining life."""

__all__: list[str] = []
