"""What is found in a surface: sizes, shapes, sections, differences from a drawing, faults."""
