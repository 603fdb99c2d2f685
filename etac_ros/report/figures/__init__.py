"""The figures of a report: one file a figure, their data in :mod:`etac_ros.metrics.curves`."""
