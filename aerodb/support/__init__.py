"""Small tools that every other package may use; none of them knows about flight.

- `Array`, `Mask`, `Integers`: type names of the arrays that are passed around (`arrays`).
- `result_key`, `version_id`, `content_sha256`, `canonical_json`: identities of stored results and
  versions, the same on every machine (`identity`).
- `Strict`, `validated` and `validated_toml`: models of hand-written files; closed to unknown keys,
  one clear error (`strict`).
- `Dual`: a value with exact first derivatives (a dual number), for sensor models; `sine`,
  `angle`, `dead_zone`, `cross`, `body_to_earth` and others work on it (`dual_numbers`).
- `in_threads` and `Threads`: one function over many items on all cores (`parallel`).
"""

import lazy_loader as lazy

__getattr__, __dir__, __all__ = lazy.attach_stub(__name__, __file__)
