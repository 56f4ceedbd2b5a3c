"""Tasks of motor skills of one joint-level body: TurnBaby, SitBaby, CrawlBaby, RunBaby."""
