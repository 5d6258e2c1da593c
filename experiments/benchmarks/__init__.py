"""Cases whose truth is known: what is drawn, who drives, two plants, and scores with intervals of what is answered."""
