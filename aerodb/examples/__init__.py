"""Built-in examples; `phoenix` is the vehicle of ``aerodb demo``."""
