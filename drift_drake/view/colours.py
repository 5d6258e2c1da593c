"""The colours that all pictures and pages share."""

INK = "#222222"
REFERENCE = "#777777"

# Okabe and Ito's colours, which the colour-blind tell apart, in an order that greys tell apart too.
RUNS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00", "#000000")

CARS = {
    "real": INK, "measured": INK, "nominal": RUNS[1], "calibrated": RUNS[1], "corrected": RUNS[0],
    "nominal car": RUNS[1], "prior": REFERENCE, "Once-OCP": RUNS[3], "Once-Info": RUNS[5], "Twice-Info": RUNS[0],
    "online": RUNS[4], "oracle": RUNS[2],
}  # fmt: skip
"""The car of that name has this colour in every picture, page and replay."""
