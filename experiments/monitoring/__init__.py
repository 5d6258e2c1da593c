"""How soon and how well the monitor sees a car change, beside what people use."""
