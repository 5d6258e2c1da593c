"""Active information gathering: lane drives planned for what they tell, driven and learnt from."""
