// The map stores depth alone.
