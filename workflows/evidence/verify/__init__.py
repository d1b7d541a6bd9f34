"""Our results beside other programs, formulas, published numbers; runs beside finer runs."""
