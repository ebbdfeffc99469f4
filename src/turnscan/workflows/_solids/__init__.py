"""What a surface is turned into on its way to CAD: sections, faces, maps of deviations."""
