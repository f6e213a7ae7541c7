"""What a selection does not need: coach, test drives, reward design, league, the committee's room."""
