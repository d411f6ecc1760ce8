"""The study. Packages import only from those before them: core, numbers, pictures, truth, counting, bounds,
experiments, claims, report.
"""
