"""Quality of one flight before anything is estimated from it: flags, segments, delays.

The way through:

1. `flag_unusable` flags wild points and samples on the ground; values stay as they are
   (`wild_points`, `segmentation`, `condition`).
2. `segments` finds segments and manoeuvres (`segmentation`, `manoeuvres`, `responses`), `delays`
   the delay of each channel against its kinematics (`delay`, `channel_rates`).
3. `aerodb.suspicions.examine` adds each `Suspicion` and returns a `Conditioning`; `to_document` and
   `from_document` convert it to and from JSON.
4. `fingerprint` and `shared_samples` find records of the same flight (`duplicates`).
"""

import lazy_loader as lazy

__getattr__, __dir__, __all__ = lazy.attach_stub(__name__, __file__)
