"""What other tools read: logs as Parquet and MCAP, vehicle parameters for CommonRoad and MuJoCo."""
