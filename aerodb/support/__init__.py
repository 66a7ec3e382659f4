"""Small tools that every other package may use; none of them knows about flight.

- `Array`, `Mask`, `Integers`: type names of the arrays that are passed around (`arrays`).
- `result_key`, `version_id`, `content_sha256`, `canonical_json`: identities of stored results and
  versions, the same on every machine (`identity`).
- `Strict`, `validated` and `validated_toml`: models of hand-written files; closed to unknown keys,
  one clear error (`strict`).
- `Dual`: a value with exact first derivatives (a dual number), for sensor models; `sine`,
  `angle`, `dead_zone`, `cross`, `body_to_earth` and others work on it (`dual_numbers`).
- `MatElements`: MAT-files of versions 5 to 7, element by element (`mat5`).
- `standard_errors` and `likelihood_gain` of a rate of false alarms (`CLAIM`, `DIFFERENCE`, `HINT`);
  `half_interval` of what people read; `false_alarms`.
- `SMALL`, `HALF`, `NEARLY_ALL` and others: levels of judgement for what is a part of something
  (`shares`).
- `require_supported_system`: an error in words on systems that are not Linux (`operating_system`).
- `counted`: a number of things in words (`words`).
- `in_threads`, `Threads` and `in_processes`: one function over many items on all cores
  (`parallel`).
"""

from typing import TYPE_CHECKING

from aerodb.lazy_faces import attach

if TYPE_CHECKING:
    from .arrays import Array, Integers, Mask
    from .dual_numbers import (
        Dual,
        Triple,
        angle,
        arcsine,
        body_to_earth,
        cross,
        dead_zone,
        dot,
        root,
        sine,
    )
    from .false_alarms import (
        CLAIM,
        DIFFERENCE,
        HINT,
        TWO_SIDED,
        half_interval,
        likelihood_gain,
        standard_errors,
    )
    from .identity import canonical_json, content_sha256, key_of, result_key, version_id
    from .mat5 import MOST_EXPANSION, Malformed, MatClass, MatElements, MatHeader, is_mat5
    from .operating_system import require_supported_system
    from .parallel import Threads, in_processes, in_threads, let_fork, one_blas_thread
    from .shares import (
        HALF,
        LARGE,
        MINUTE,
        NEARLY_ALL,
        NEGLIGIBLE,
        NOTABLE,
        QUARTER,
        SLIGHT,
        SMALL,
        SUBSTANTIAL,
    )
    from .strict import Strict, validated, validated_toml
    from .toml import parsed_toml
    from .words import counted

__getattr__, __dir__, __all__ = attach(__name__, __file__)
