"""Numbers of things in words."""


def counted(n: int, what: str) -> str:
    """Return a number of things in words.

    >>> counted(1, "flight"), counted(2, "flight")
    ('1 flight', '2 flights')
    """
    return f"{n} {what}{'' if n == 1 else 's'}"
