"""Health indices, control charts and other alarms on readings."""
