"""Contact detection: which grains are near (broad), where they touch (narrow), and what a pair remembers (pairs)."""
