"""The model of discs and annuli as it was, until its curves are followed with all others."""
