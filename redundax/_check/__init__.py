"""The referee of joint loads that other programs print: which are determined, and whether those are right."""
