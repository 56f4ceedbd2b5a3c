"""Games between players on one floor: PushOut in a ring, Soccer on a pitch."""
