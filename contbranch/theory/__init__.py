"""Closed-form theories of single-asperity contact, one file a theory: hertz, dmt, jkr, maugis, cos.

Every function is vectorised, takes the radius of curvature, the effective modulus and the work of adhesion as keywords,
and has them equal to one by default, which are the reduced units (23)-(26) of the paper.
"""
