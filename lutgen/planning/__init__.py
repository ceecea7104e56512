"""The least model that a scene needs: `lutgen plan`.

A tolerance holds where the 95th percentile of the error of random skins of the scene stays within it: CIEDE2000 for
colors, EE differences of all ACEScg channels for profiles, these in each of eight bakes with different seeds. Least
means that no recipe one rung down holds as well: next fewer wavelengths, a quarter of the photons, or three quarters of
the nodes of one axis. Of the least recipes it is the one whose bake takes the fewest seconds, then bytes.
"""
