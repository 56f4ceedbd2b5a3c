"""Tasks in which a body learns to move: TurnBaby, SitBaby, CrawlBaby, RunBaby."""
