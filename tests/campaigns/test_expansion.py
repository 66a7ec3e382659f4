"""How often a permitted envelope contains an unsafe condition, over planted aircraft."""

from itertools import pairwise

import pytest

from tests.campaigns.expansion import START, STEP, TARGET, Campaign, fly_campaign, rates

#: Seeds flown in the suite, in long steps, and in full.
REDUCED, FULL = 1, 30
LONG = 6.0
#: Permitted envelopes with an unsafe condition, at most: margins hold at two standard errors, one
#: side of which is 2.3 % of the points; a campaign has up to six.
MOST = 0.15


@pytest.mark.campaign
@pytest.mark.heavy
@pytest.mark.parametrize("kind", ["smooth", "sudden"])
def test_permitted_envelopes_are_safe_as_often_as_their_margins_say(kind, trials) -> None:
    """What decides knows the records and one rule that is the same for every aircraft."""
    count = trials(REDUCED, FULL)
    step = LONG if count == REDUCED else STEP
    flown = [fly_campaign(kind, seed, step) for seed in range(count)]
    print(f"{kind}: {rates(flown)}")
    for each in flown:
        assert each.flown[0] == START
        assert all(0.0 < a - b <= step + 1e-9 for a, b in pairwise(each.flown))
        assert each.reached == (each.flown[-1] == TARGET)
        assert each.reached or each.ended
    assert sum(each.unsafe for each in flown) <= MOST * len(flown)
    assert any(len(each.flown) > 1 for each in flown)


def test_rates_count_unsafe_envelopes_with_their_interval() -> None:
    safe = Campaign("smooth", 0, [42.0, 38.0], 34.0, False, False, "a mode")
    said = rates([safe, safe, safe, Campaign("smooth", 1, [42.0, 30.0], 36.0, True, True, "")])
    assert "1 of 4" in said
    assert "25.0%" in said
    assert "0.6% to 80.6%" in said  # Clopper and Pearson
    assert "50% of the safe range" in said
