"""Shares that count as small, as half, as nearly all: one level of judgement for all who decide.

Where no statistic gives a share, it is one of these. Each use has its reason where it stands; a
number of its own, as .27, would need evidence that .3 is wrong.
"""

from typing import Final

#: Share that counts as none: what rounding and single samples make.
NEGLIGIBLE: Final = 0.001
#: Share that is not worth a sentence.
MINUTE: Final = 0.01
#: Share that hardly differs from none.
SLIGHT: Final = 0.05
#: Share that counts as small: the rest decides.
SMALL: Final = 0.1
#: Share that is noticed beside the rest.
NOTABLE: Final = 0.2
#: Share that leaves three times as much to all else.
QUARTER: Final = 0.25
#: Share that noise and other causes seldom have.
SUBSTANTIAL: Final = 0.3
#: Share from which one cause has more than all others.
HALF: Final = 0.5
#: Share that leaves a quarter to all else.
LARGE: Final = 0.75
#: Share that leaves to all else what is small.
NEARLY_ALL: Final = 0.9
