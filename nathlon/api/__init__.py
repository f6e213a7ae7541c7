"""What `import nathlon` offers: functions that return results, and the results."""
