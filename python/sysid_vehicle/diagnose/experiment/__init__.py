"""What to drive next, and what an effect does unnoticed to the fitted parameters."""
