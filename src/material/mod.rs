//! Constitutive laws: one file a law, generic in the scalar and the dimension.
