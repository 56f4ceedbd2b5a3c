"""Experts of motor skills: TurnBaby, SitBaby, CrawlBaby, RunBaby."""
