"""Known answers of the field, computed on the user's own computer.

`known_answers.csv` states them with their sources; the functions of `answers` compute them.
"""
