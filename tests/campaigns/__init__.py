"""Campaigns that measure error rates of the closed loop through the commands that ship, on aircraft
of JSBSim: ``python -m tests.campaigns.closed_loop --help``."""
