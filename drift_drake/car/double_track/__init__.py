"""A car with four tyres of the Magic Formula, load transfer, roll and an open differential."""
