"""Condition monitoring of electro-mechanical actuators and other rotating machines."""

__version__ = "0.1.0"
