"""Recordings that are read from files: layouts, readers, folders."""
