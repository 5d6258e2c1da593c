"""How soon and how well the monitor sees a car change, compared with what people use."""
